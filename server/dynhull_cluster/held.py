"""What the watchers of a hull hold after an event, as a gateway follows it."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import key_list
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2
from dynhull_server.engine.difference import difference
from dynhull_server.rpc.decode import decode_points
from dynhull_server.rpc.decode_batch import decode_keys
from dynhull_server.rpc.encode import encode_change
from dynhull_server.state.hull_state import VertexKeys


@dataclass(frozen=True, slots=True)
class WatcherHull:
    """What a watcher holds at a revision.

    Attributes:
        revision: the revision.
        vertices: the vertices.
        keys: their keys if the watchers asked for them, as an array of objects.
        center: the longitude and the latitude of the centre of a geographic hull that has one.
    """

    revision: int
    vertices: Points
    keys: VertexKeys | None
    center: tuple[float, float] | None

    @classmethod
    def of(cls, event: pb.WatchResponse, *, keys: bool) -> "WatcherHull":
        """What the watchers of a snapshot hold."""
        vertices = decode_points(event.snapshot.vertices, "vertices")
        return cls(event.revision, vertices, _keys(event.snapshot.vertex_keys) if keys else None, _center(event))

    def after(self, event: pb.WatchResponse) -> "WatcherHull":
        """What they hold after the next event. O(number of vertices), or O(1) for a progress mark."""
        vertices, keys, change = self.vertices, self.keys, event.change
        if event.HasField("change"):
            vertices = _edited(vertices, decode_points(change.added, "added"), change)
            if keys is not None:
                keys = _edited(keys, _keys(change.added_keys), change)
                keys[list(change.renamed_indices)] = _keys(change.renamed_keys)
        return WatcherHull(event.revision, vertices, keys, _center(event))

    def change_to(self, later: "WatcherHull", encoding: points_pb2.PointEncoding) -> pb.HullChange | None:
        """The change from these vertices to later ones, None if they are the same. O(h log h) for h vertices."""
        edit = difference(self.vertices, later.vertices, self.keys, later.keys)
        if not edit:
            return None
        return encode_change(self.vertices[edit.removed], later.vertices, edit, _plain(later.keys), encoding)


def _center(event: pb.WatchResponse) -> tuple[float, float] | None:
    return (event.center.longitude, event.center.latitude) if event.HasField("center") else None


def _keys(message: points_pb2.Keys) -> VertexKeys:
    keys = decode_keys(message, "keys")
    return np.array([] if keys is None else key_list(keys), object)


def _plain(keys: VertexKeys | None) -> VertexKeys | None:
    """Keys as the encoder takes them: integers in an array of their own."""
    return keys.astype(np.uint64) if keys is not None and len(keys) and isinstance(keys[0], int) else keys


def _edited(rows: npt.NDArray[Any], added: npt.NDArray[Any], change: pb.HullChange) -> npt.NDArray[Any]:
    kept = np.roll(np.delete(rows, list(change.removed_indices), axis=0), -change.rotation, axis=0)
    edited = np.empty((len(kept) + len(added), *rows.shape[1:]), rows.dtype)
    is_added = np.zeros(len(edited), np.bool_)
    is_added[list(change.added_indices)] = True
    edited[is_added] = added
    edited[~is_added] = kept
    return edited
