"""Collision and distance in space by python-fcl, which has a solver of its own (libccd)."""

import fcl
import numpy as np

from dynhull.static import hull_nd


def fcl_body(points):
    hull = hull_nd(points)
    faces = np.column_stack([np.full(len(hull.faces), 3), hull.faces]).ravel()
    return fcl.CollisionObject(fcl.Convex(hull.vertices, len(hull.faces), faces), fcl.Transform())


def fcl_distance(a, b):
    """The distance, negative where the two intersect."""
    if fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()):
        return -1.0
    return fcl.distance(a, b, fcl.DistanceRequest(), fcl.DistanceResult())
