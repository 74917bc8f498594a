"""Intersection, distance and depth of overlap of convex sets, from their support functions alone."""

from .contact import Contact, contact, intersect
from .pairs import distance_many, intersect_many

__all__ = ["Contact", "contact", "distance_many", "intersect", "intersect_many"]
