"""Whether convex sets intersect, how far apart they are, and how deep they overlap, from support functions alone."""

from ._contact import Contact, contact, intersect
from ._pairs import distance_many, intersect_many

__all__ = ["Contact", "contact", "distance_many", "intersect", "intersect_many"]
