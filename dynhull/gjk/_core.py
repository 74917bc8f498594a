"""Rounded shapes as a core and a radius: GJK ends after a few steps on cores, but only converges on curves."""

from .._base import Hull
from ..convex import Ball, Cloud, Convex, Mapped, Sum


def core(shape: Convex) -> tuple[Convex, float]:
    """A shape and a radius; the given shape is all points within the radius of that shape."""
    if isinstance(shape, Ball):
        return Cloud(shape.centre[None]), shape.radius
    if isinstance(shape, Sum):
        cores = [core(part) for part in shape.parts]
        radius = sum(radius for _, radius in cores)
        return (Sum([part for part, _ in cores]), radius) if radius else (shape, 0.0)
    if isinstance(shape, Mapped) and shape.stretch is not None:
        inner, radius = core(shape.shape)
        return (
            (Mapped(inner, shape.matrix, shape.offset, shape.stretch), radius * shape.stretch)
            if radius
            else (shape, 0.0)
        )
    return shape, 0.0


def is_polytope(shape: Convex) -> bool:
    """Whether the shape is known to have finitely many vertices."""
    if isinstance(shape, Sum):
        return all(is_polytope(part) for part in shape.parts)
    return is_polytope(shape.shape) if isinstance(shape, Mapped) else isinstance(shape, Cloud | Hull)
