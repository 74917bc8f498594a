"""Calls about what a few bad points cannot spoil, made as those in `_calls`, and their answers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from dynhull._value import Value
from dynhull_proto.v1 import hull_service_pb2 as pb

from ._arguments import whole
from ._calls import Call
from ._keys import decode_names
from ._messages import Points, decode_points

if TYPE_CHECKING:
    import numpy.typing as npt

    from ._keys import KeyTuple


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Layers(Value):
    """The outermost convex layers at one revision, each with (h, 2) vertices as those of `Hull`.

    `keys` are those of the vertices of each layer, if requested; None for a hull without keys.
    """

    revision: int
    layers: tuple[Points, ...]
    keys: tuple[KeyTuple, ...] | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Influence(Value):
    """The (h, 2) vertices of a hull, and the area that it would lose without each of them, (h,).

    In square metres for a geographic hull. `keys` are those of the vertices, if requested; None for a hull without
    keys.
    """

    revision: int
    vertices: Points
    areas: npt.NDArray[np.float64]
    keys: KeyTuple | None = None


def layers(
    name: str, k: int, *, keys: bool = False, min_revision: int = 0, timeout: float | None = None
) -> Call[Layers]:
    """The `k` outermost convex layers, from 1 to 1000; fewer if the points run out. Exact.

    Layer 1 is the hull; the next layer is the hull of the points left when all points at the vertices of the layers
    before are taken out. With `keys`, also the keys of the vertices, in a keyed hull. LimitExceededError for layers
    with more than 1 000 000 vertices together.
    """
    request = pb.GetLayersRequest(
        name=name, min_revision=min_revision, layer_count=whole("k", k, bits=32), include_keys=keys
    )

    def decode(response: pb.GetLayersResponse) -> Layers:
        ends = np.cumsum(response.vertex_counts, dtype=np.intp)
        found = tuple(np.split(decode_points(response.vertices), ends[:-1])) if len(ends) else ()
        named = None
        if response.HasField("vertex_keys"):
            all_keys = decode_names(response.vertex_keys)
            counts = response.vertex_counts
            named = tuple(all_keys[end - count : end] for end, count in zip(ends.tolist(), counts, strict=True))
        return Layers(response.revision, found, named)

    return Call("GetLayers", request, decode, timeout)


def influence(name: str, *, keys: bool = False, min_revision: int = 0, timeout: float | None = None) -> Call[Influence]:
    """The area that the hull would lose without each of its vertices, all points at its place: who stretches the hull.

    The exact value rounded once; in a geographic hull in square metres, within 0.1 for each vertex that leaves or
    appears. With `keys`, also the keys of the vertices, in a keyed hull. LimitExceededError for a hull with more than
    100 000 vertices.
    """
    request = pb.GetInfluenceRequest(name=name, min_revision=min_revision, include_keys=keys)

    def decode(response: pb.GetInfluenceResponse) -> Influence:
        named = decode_names(response.vertex_keys) if response.HasField("vertex_keys") else None
        areas = np.array(response.areas, np.float64)
        return Influence(response.revision, decode_points(response.vertices), areas, named)

    return Call("GetInfluence", request, decode, timeout)
