"""The ways of keys through the past of a hull."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dynhull._value import Value
from dynhull_proto.v1 import hull_service_pb2 as pb

from ._accuracies import decode_accuracies
from ._calls import Call
from ._keys import checked_keys, encode_keys, plain_keys
from ._messages import decode_points
from ._past import encode_moment
from ._times import decode_times, encode_duration

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator
    from datetime import timedelta

    import numpy.typing as npt

    from dynhull.arrays import Points

    from ._past import When


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Track(Value):
    """The way of a key, in n rows; `times, points = track` unpacks it.

    The first row is where the key was at the start, if it was in the hull then. A row with NaN says that it left the
    hull: it was removed, or its time had come.

    Attributes:
        times: (n,) int64, when the key came to each place, by commit: microseconds since 1970. At first the start. 0
            where an early version of the server did not store it.
        points: (n, 2) the places; NaN from where on the key was not there.
        revisions: (n,) uint64, the revision of each row.
        event_times: (n,) int64, the times that were sent with the positions; 0 for none. None if there are none at all.
        accuracies: (n,) how far each place may be from where the key really was, in units of the coordinates, or metres
            on the globe; 0 for not at all. None if all are exact.
    """

    times: npt.NDArray[np.int64]
    points: Points
    revisions: npt.NDArray[np.uint64]
    event_times: npt.NDArray[np.int64] | None = None
    accuracies: npt.NDArray[np.float64] | None = None

    def __iter__(self) -> Iterator[Any]:
        yield self.times
        yield self.points

    def __len__(self) -> int:
        return len(self.times)


def track(
    name: str,
    keys: Any,
    start: When | None = None,
    end: When | None = None,
    *,
    every: float | timedelta | str | None = None,
    timeout: float | None = None,
) -> Call[dict[str | int, Track]]:
    """Where keys were between two moments: a `Track` for each, in the order of `keys`.

    >>> from dynhull_client import HullClient
    >>> client = HullClient()  # doctest: +SKIP
    >>> tracks = client.track("fleet", ["LH400"], "2026-11-24T06:00Z", "2026-11-24T18:00Z")  # doctest: +SKIP
    >>> times, points = tracks["LH400"]  # doctest: +SKIP

    A key that was never there has no rows. What is held in quarantine is no part of a track unless it is released.

    Raises:
        HullUnsuitableError: the hull is not keyed, is over shards, or has a window of a number of points, of which the
            past does not say who left.
        RevisionForgottenError: the server does not keep these revisions any more.

    Args:
        name: the hull.
        keys: the keys.
        start: a revision, or a time as for `at`: the last revision committed at or before it. None for the oldest
            revision that can be read.
        end: the same; None for the newest revision.
        every: of each key the last row in each span of this length alone, in seconds, as a timedelta, or as text
            such as 30m. The first span begins at the start.
        timeout: seconds that all of it may take, instead of the client's.
    """
    wanted = checked_keys(keys)
    names = tuple(dict.fromkeys(plain_keys(wanted)))
    request = pb.TrackRequest(name=name, keys=encode_keys(checked_keys(names) if len(names) < len(wanted) else wanted))
    encode_moment(request, "start", start, "start")
    encode_moment(request, "end", end, "end")
    if every is not None:
        request.every.CopyFrom(encode_duration(every, "every"))
    return Call("Track", request, lambda parts: _decoded(parts, names), timeout, in_parts=True)


def _decoded(parts: Iterable[pb.TrackResponse], names: tuple[Any, ...]) -> dict[str | int, Track]:
    received = list(parts)
    rows = np.concatenate([np.array(part.key_indices, np.int64) for part in received])
    order = np.argsort(rows, kind="stable")
    times = np.concatenate([decode_times(part.times).view(np.int64) for part in received])[order]
    points = np.concatenate([decode_points(part.positions) for part in received])[order]
    revisions = np.concatenate([np.array(part.revisions, np.uint64) for part in received])[order]
    event_times = np.concatenate([_event_times(part) for part in received])[order]
    accuracies = np.concatenate([_accuracies(part) for part in received])[order]
    ends = np.searchsorted(rows[order], np.arange(len(names) + 1))
    found: dict[str | int, Track] = {}
    for row, key in enumerate(names):
        own = slice(ends[row], ends[row + 1])
        found[key] = Track(times[own], points[own], revisions[own], _any(event_times[own]), _any(accuracies[own]))
    return found


def _any(column: Any) -> Any:
    """The column; None where it says nothing."""
    return column if column.any() else None


def _accuracies(part: pb.TrackResponse) -> npt.NDArray[np.float64]:
    found = decode_accuracies(part)
    return np.zeros(len(part.key_indices)) if found is None else found


def _event_times(part: pb.TrackResponse) -> npt.NDArray[np.int64]:
    if not part.HasField("event_times"):
        return np.zeros(len(part.key_indices), np.int64)
    found: npt.NDArray[np.int64] = decode_times(part.event_times).view(np.int64)
    return found
