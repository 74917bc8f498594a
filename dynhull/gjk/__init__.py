"""Intersection, distance and depth of overlap of convex sets, from their support functions alone."""

from ._contact import Contact, contact, intersect
from ._pairs import distance_many, intersect_many

__all__ = ["Contact", "contact", "distance_many", "intersect", "intersect_many"]
