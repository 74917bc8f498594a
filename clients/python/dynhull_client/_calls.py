"""Each call once: the request, how to read the answer, and the documentation.

The methods of `HullClient` and `AsyncHullClient` are made of these functions and those in `_uses`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Generic, Literal, Never, TypeVar
from uuid import uuid4

import grpc
import numpy as np

from dynhull.arrays import as_points
from dynhull_proto.v1 import hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_surface.settings import HullSettings

from . import _messages as messages
from ._arguments import positive, whole
from ._batch import Batch
from ._errors import DynhullError, HullExistsError, HullNotFoundError, RestoredError
from ._history_messages import encode_history
from ._keys import checked_keys, decode_names, encode_keys
from ._messages import (
    Applied,
    Counted,
    Crossings,
    Distances,
    Entities,
    Hull,
    HullInfo,
    Located,
    Positions,
    Sampled,
    Stored,
    Supported,
    Tangents,
    Verification,
)
from ._quarantine_messages import encode_quarantine
from ._settings import SPAN, documenting_settings, encode_center, encode_settings
from ._times import encode_duration

if TYPE_CHECKING:
    from collections.abc import Mapping
    from datetime import timedelta

    import numpy.typing as npt
    from google.protobuf.message import Message

    from dynhull.keys import KeyType
    from dynhull_surface.settings import Ahead, Clock, Ordering

    from ._batch import Missing, Only
    from ._hull_copy import HullCopy
    from ._quarantine_messages import Quarantine

Answer = TypeVar("Answer")


# The number of progress marks within the time after which a copy is too old to answer.
MARKS = 3


def _nothing(_: DynhullError) -> None:
    return None


@dataclass(frozen=True, slots=True)
class Call(Generic[Answer]):
    """A call to make.

    Attributes:
        method: the RPC's name.
        request: the message to send.
        decode: makes the answer from the message received.
        timeout: seconds; None for the client's.
        repeatable: whether it may be sent again when its outcome is unknown.
        instead: the call to make after an error; None for none.
        awaits_hull: whether to repeat it until there is a hull and a server.
        in_parts: whether the answer is a stream of messages, which `decode` receives as a list.
    """

    method: str
    request: Message
    decode: Callable[[Any], Answer]
    timeout: float | None
    repeatable: bool = True
    instead: Callable[[DynhullError], Call[Answer] | None] = _nothing
    awaits_hull: bool = False
    in_parts: bool = False


# A list: the call for a page of it, given the token of the page; the next token is empty after the last one.
Pages = Callable[[str], Call[tuple[list[Answer], str]]]


@documenting_settings(HullSettings, SPAN)
def create_hull(  # noqa: D417  # the settings have their descriptions
    name: str,
    *,
    keyed: KeyType | None = None,
    max_age: float | timedelta | str | None = None,
    max_points: int | None = None,
    clock: Clock = "server",
    max_skew: float | timedelta | str | None = None,
    ahead: Ahead = "refuse",
    ordering: Ordering = "arrival",
    point_limit: int | None = None,
    geographic: bool = False,
    center: tuple[float, float] | None = None,
    quarantine: Quarantine | None = None,
    shards: int | None = None,
    history: str | float | timedelta | bool | None = None,
    history_bytes: int | None = None,
    exist_ok: bool = False,
    timeout: float | None = None,
) -> Call[HullInfo]:
    """Create an empty hull. Its settings are fixed from then on.

    A geographic hull takes and returns longitudes and latitudes in degrees, as `dynhull.GeoHull` does: its edges are
    great circles, and its lengths and areas are metres and square metres on WGS 84.

    With `max_age` or `max_points`, the hull has a sliding window: points leave when they are too old or too many. The
    time of a point is its event time or, if the batch has none, the time at which the server received it.

    Args:
        name: 1 to 200 letters a to z and A to Z, digits and "._-/".
        quarantine: the rules that a keyed hull begins with, which hold bad positions out; None for none.
            `set_quarantine` changes them; those of an existing hull are not compared.
        SETTINGS
        history: for how long its past is kept: True for ever, a timedelta, seconds, or text such as "30d"; None for not
            at all. `set_history` changes it; that of an existing hull is not compared.
        history_bytes: in how many bytes at most, the oldest going first; None for any number.
        exist_ok: whether to return an existing hull of that name and kind, with its points. HullExistsError if it has
            other settings, or without `exist_ok`.
        timeout: seconds, instead of the client's.
    """
    given = locals()
    config = hull_pb2.HullConfig()
    encode_settings(HullSettings, given, config)
    if quarantine is not None:
        config.quarantine.CopyFrom(encode_quarantine(quarantine))
    if (kept := encode_history(history, history_bytes)) is not None:
        config.history.CopyFrom(kept)
    create: Call[HullInfo] = Call(
        "CreateHull",
        pb.CreateHullRequest(name=name, config=config),
        lambda response: messages.decode_info(response.hull),
        timeout,
        repeatable=exist_ok,
        instead=lambda error: existing if exist_ok and isinstance(error, HullExistsError) else None,
    )
    wanted = messages.decode_info(hull_pb2.Hull(name=name, config=config))
    existing: Call[HullInfo] = Call(
        "GetHull",
        pb.GetHullRequest(name=name, view=pb.HULL_VIEW_BASIC),
        lambda response: _as_wanted(messages.decode_info(response.hull), wanted),
        timeout,
        instead=lambda error: create if isinstance(error, HullNotFoundError) else None,  # deleted in the meantime
    )
    return create


def encode_layer(layer: int) -> int:
    """A convex layer, from 1, in the form of a message."""
    number = whole("layer", layer, bits=32, least=1)
    return number if number > 1 else 0


def _as_wanted(existing: HullInfo, wanted: HullInfo) -> HullInfo:
    """The existing hull; HullExistsError if it has other settings than the one to create."""
    for setting in ("keyed", "window", "ordering", "geographic", "shards"):
        has, wants = getattr(existing, setting), getattr(wanted, setting)
        if has != wants:
            message = f"the hull {existing.name!r} exists with other settings: its {setting} is {has!r}, not {wants!r}"
            raise HullExistsError(message, grpc.StatusCode.ALREADY_EXISTS, "HULL_EXISTS", {"value": existing.name})
    return existing


def recenter(name: str, center: tuple[float, float] | None = None, *, timeout: float | None = None) -> Call[HullInfo]:
    """Move the centre of a geographic hull, as one revision: the hull is built anew.

    Decisions that depend on nanometres may change. HullUnsuitableError if the hull is a plane, if a point is beyond 85
    degrees from the new centre, or if there is no point to choose it from.

    Args:
        name: the hull.
        center: longitude and latitude; None for the mean direction of the present points.
        timeout: seconds, instead of the client's.
    """
    request = pb.RecenterRequest(name=name, center=None if center is None else encode_center(center))
    return Call("Recenter", request, lambda response: messages.decode_info(response.hull), timeout, repeatable=False)


def reshard(name: str, shards: int, *, timeout: float | None = None) -> Call[HullInfo]:
    """Divide the points of a hull over shards among another number of shards, as one revision: the hull stays as it is.

    Batches, and questions about all points, wait until that is done. It is done also if the call ends before, as at its
    timeout, unless the server ends: then the hull has either its old shards or the new ones.

    Args:
        name: the hull. HullUnsuitableError if it is not divided.
        shards: the number of shards, 1 to 1024.
        timeout: seconds, instead of the client's.
    """
    request = pb.ReshardRequest(name=name, shards=whole("shards", shards, bits=32, least=1))
    return Call("Reshard", request, lambda response: messages.decode_info(response.hull), timeout, repeatable=False)


def wait_for_hull(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[HullInfo]:
    """Wait until there is a hull of that name, and a server if there is none yet.

    The client asks again after 0.1 to 1 seconds. DeadlineError after the timeout.

    Args:
        name: the hull.
        min_revision: a revision that the hull must have reached.
        timeout: seconds, instead of the client's.
    """
    request = pb.GetHullRequest(name=name, min_revision=min_revision, view=pb.HULL_VIEW_BASIC)
    return Call("GetHull", request, lambda response: messages.decode_info(response.hull), timeout, awaits_hull=True)


def delete_hull(name: str, *, timeout: float | None = None) -> Call[None]:
    """Delete a hull and its points."""
    return Call("DeleteHull", pb.DeleteHullRequest(name=name), lambda _: None, timeout, repeatable=False)


def list_hulls(prefix: str = "", *, timeout: float | None = None) -> Pages[HullInfo]:
    """The hulls whose names begin with `prefix`, in the order of their names, fetched page by page."""

    def decode(response: pb.ListHullsResponse) -> tuple[list[HullInfo], str]:
        return [messages.decode_info(each) for each in response.hulls], response.next_page_token

    return lambda token: Call("ListHulls", pb.ListHullsRequest(prefix=prefix, page_token=token), decode, timeout)


def apply(  # noqa: D417  # unnamed takes nothing
    name: str,
    *unnamed: Never,
    insert: npt.ArrayLike | None = None,
    delete: npt.ArrayLike | None = None,
    move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    times: Any = None,
    missing: Missing = "raise",
    producer: str = "",
    sequence: int = 0,
    may_skip: bool = False,
    timeout: float | None = None,
) -> Call[Applied]:
    """Apply one batch: all of it or nothing, as one revision.

    Args:
        name: the hull.
        insert: (n, 2) points to insert.
        delete: (n, 2) points to delete.
        move: origins and destinations, (n, 2) each: row by row a delete and an insert.
        times: (n,) event times of the points to insert, in a hull with a window; as for `put`.
        missing: for a point to delete that the hull does not hold: "raise" refuses the batch with PointMissingError,
            which names the row; "count" skips the point and counts it.
        producer: a name for the sender that numbers the batch, so that it is applied once however often it is sent.
        sequence: the batch's number. A producer numbers its batches to a hull 1, 2, 3, ...; SequenceGapError reports
            the next number.
        may_skip: whether numbers rise and may skip, as the offsets of a log do: then a batch with any greater number
            than the last is new. Send it after the answer to the one before.
        timeout: seconds, instead of the client's.
    """
    if unnamed:
        raise TypeError(
            f"apply({name!r}, points) does not say what to do with the points: "
            f"write apply({name!r}, insert=points) or apply({name!r}, delete=points)"
        )
    batch = Batch(insert=insert, delete=delete, move=move, times=times, missing=missing)
    return apply_batch(name, batch, producer, sequence, may_skip, timeout)


def put(
    name: str,
    keys: Any,
    points: npt.ArrayLike,
    times: Any = None,
    *,
    remove: Any = None,
    only: Only | None = None,
    ttl: float | timedelta | str | None = None,
    expire_times: Any = None,
    accuracies: Any = None,
    producer: str = "",
    sequence: int = 0,
    may_skip: bool = False,
    timeout: float | None = None,
) -> Call[Applied]:
    """Put keys as one batch, as one revision: a new key is inserted, a known key moves.

    HullUnsuitableError if the hull has no keys or keys of the other kind; DuplicateKeyError if a key comes twice.

    Args:
        name: the hull.
        keys: n keys: strings or integers in a list, a numpy array, a column of pandas, polars or pyarrow; or
            `dynhull.keys.PackedKeys`.
        points: (n, 2) their positions.
        times: (n,) their event times: datetimes or ISO 8601 with a time zone, datetime64 in UTC, a column of such times
            with a time zone, or integers of microseconds since 1970.
        remove: keys to remove in the same batch.
        only: "absent" puts new keys only, "present" known keys only; the others are skipped and counted.
        ttl: the time after which the keys leave the hull, in seconds, as a timedelta, or as text such as 30m.
        expire_times: (n,) the times at which the keys leave, instead of `ttl`.
        accuracies: (n,) how far the positions may be from where the keys really are, in units of the coordinates, or
            metres on the globe; without them, or 0, not at all. Fences with `by_accuracy` ask for them.
        producer: as for `apply`.
        sequence: as for `apply`.
        may_skip: as for `apply`.
        timeout: seconds, instead of the client's.
    """
    columns = {"keys": keys, "points": points, "times": times, "expire_times": expire_times, "accuracies": accuracies}
    batch = Batch(**columns, remove=remove, only=only, ttl=ttl)
    return apply_batch(name, batch, producer, sequence, may_skip, timeout)


def remove(
    name: str,
    keys: Any,
    *,
    missing: Missing = "count",
    producer: str = "",
    sequence: int = 0,
    may_skip: bool = False,
    timeout: float | None = None,
) -> Call[Applied]:
    """Remove keys as one batch.

    Args:
        name: the hull.
        keys: n keys, as for `put`.
        missing: for a key that the hull does not hold: "count" skips the key and counts it; "raise" refuses the batch
            with KeyMissingError, which names the row.
        producer: as for `apply`.
        sequence: as for `apply`.
        may_skip: as for `apply`.
        timeout: seconds, instead of the client's.
    """
    return apply_batch(name, Batch(remove=keys, missing=missing), producer, sequence, may_skip, timeout)


def transfer(
    batches: Mapping[str, Batch],
    *,
    producer: str = "",
    sequence: int = 0,
    may_skip: bool = False,
    uids: Mapping[str, str] | None = None,
    timeout: float | None = None,
) -> Call[dict[str, Applied]]:
    """Apply a batch to each of 2 to 16 hulls: all of them, as one revision each, or none.

    Nobody sees some of the revisions without the others: a key that leaves one hull for another is always in exactly
    one of them. Returns the effect of each batch, by hull.

    >>> client.transfer(  # doctest: +SKIP
    ...     {"fleet/north": Batch(remove=["LH400"]), "fleet/south": Batch(keys=["LH400"], points=[[4, 1]])}
    ... )

    Args:
        batches: the batch of each hull. The hulls must exist.
        producer: as for `apply`.
        sequence: as for `apply`; counted in each of the hulls.
        may_skip: as for `apply`.
        uids: the uids of hulls whose producer has this number, by hull: RestoredError if a backup of one of them was
            restored since then.
        timeout: seconds, instead of the client's.
    """
    uids = uids or {}
    parts = [pb.HullBatch(name=name, batch=batch.message, uid=uids.get(name)) for name, batch in batches.items()]
    request = pb.ApplyTogetherRequest(batches=parts, producer=producer, sequence=sequence, may_skip=may_skip)

    def decode(response: pb.ApplyTogetherResponse) -> dict[str, Applied]:
        return dict(zip(batches, map(messages.decode_applied, response.results), strict=True))

    return Call("ApplyTogether", request, decode, timeout, repeatable=sequence > 0)


def apply_batch(
    name: str, batch: Batch, producer: str, sequence: int, may_skip: bool, timeout: float | None
) -> Call[Applied]:
    """The call that applies a batch."""
    request = pb.ApplyRequest(name=name, batch=batch.message, producer=producer, sequence=sequence, may_skip=may_skip)
    return Call(
        "Apply", request, lambda response: messages.decode_applied(response.result), timeout, repeatable=sequence > 0
    )


def last_sequence(name: str, producer: str, *, timeout: float | None = None) -> Call[int]:
    """The number of the last batch of a producer that was applied; 0 if there is none."""
    request = pb.GetProducerRequest(name=name, producer=producer)
    return Call("GetProducer", request, lambda response: int(response.last_sequence), timeout)


@dataclass(frozen=True, slots=True)
class Known:
    """What a hull knows of a producer.

    Attributes:
        sequence: the number of the last batch that was applied; 0 if there is none.
        uid: the uid of the hull; empty if the server is an older one.
    """

    sequence: int
    uid: str


def known(writing: Writing) -> Call[Known]:
    """What the hull knows of the producer of a writer; RestoredError if it lacks what an earlier writer had."""

    def decode(response: pb.GetProducerResponse) -> Known:
        last = int(response.last_sequence)
        if writing.uid and response.uid == writing.uid and last < writing.acknowledged:
            raise led_back(writing, last)
        return Known(last, response.uid)

    request = pb.GetProducerRequest(name=writing.name, producer=writing.producer, uid=writing.uid)
    return Call("GetProducer", request, decode, None)


def led_back(writing: Writing, last: int) -> RestoredError:
    """The error of a writer whose hull lacks acknowledged batches, though it has the same uid."""
    message = (
        f"the hull {writing.name!r} was led back to an earlier state, and the last batch of producer "
        f"{writing.producer!r} that it has is number {last}: those after it are gone, so go on from there, with a new "
        "writer"
    )
    metadata = {"value": writing.name, "uid": writing.uid, "last": str(last), "expected": str(last + 1)}
    return RestoredError(message, grpc.StatusCode.FAILED_PRECONDITION, "RESTORED", metadata)


def locate(
    name: str,
    xy: npt.ArrayLike | None = None,
    *,
    keys: Any = None,
    keys_of: str = "",
    keys_min_revision: int = 0,
    layer: int = 1,
    min_revision: int = 0,
    timeout: float | None = None,
) -> Call[Located]:
    """The side of each of (n, 2) points: +1 inside, 0 on the boundary, -1 outside. Exact.

    With `min_revision`, this and the other reads wait until the hull has reached that revision.

    Args:
        name: the hull.
        xy: (n, 2) points,
        keys: or keys instead, whose positions are located; a missing one is on side -128.
        keys_of: the keyed hull that has the keys; by default the hull itself, at the same revision.
        keys_min_revision: a revision of that other hull to wait for.
        layer: the convex layer to ask, as in `layers`; 1 is the hull itself. A layer without points is an empty hull.
        min_revision: a revision of the hull to wait for.
        timeout: seconds, instead of the client's.
    """
    request = pb.LocateRequest(name=name, min_revision=min_revision, layer=encode_layer(layer))
    _ask_about(request, xy, keys, keys_of, keys_min_revision)

    def decode(response: pb.LocateResponse) -> Located:
        sides = np.frombuffer(response.sides, np.int8)
        return Located(response.revision, sides, response.keys_revision if keys_of else None)

    return Call("Locate", request, decode, timeout)


def positions(name: str, keys: Any, *, min_revision: int = 0, timeout: float | None = None) -> Call[Positions]:
    """The positions of keys, (n, 2), with NaN for missing ones. HullUnsuitableError if the hull is not keyed."""
    request = pb.GetPositionsRequest(name=name, min_revision=min_revision, keys=encode_keys(checked_keys(keys)))
    return Call("GetPositions", request, messages.decode_positions, timeout)


def entities(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[Entities]:
    """All keys, their positions and times at one revision. HullUnsuitableError if the hull is not keyed."""
    request = pb.ReadEntitiesRequest(name=name, min_revision=min_revision)
    return Call("ReadEntities", request, messages.decode_entities, timeout, in_parts=True)


def read_points(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[Stored]:
    """All points of a hull at one revision, part by part, with keys and times: those of large hulls need not be held.

    There is at least one part. The call begins when the first one is asked for, and is repeated only before that one is
    there. The server ends it if a part is not received for ten minutes (`dynhull serve --max-watch-lag`).

    >>> from dynhull_client import HullClient
    >>> client = HullClient()  # doctest: +SKIP
    >>> sum(len(part.points) for part in client.read_points("fleet"))  # doctest: +SKIP
    4

    Args:
        name: the hull.
        min_revision: a revision that it must have reached.
        timeout: seconds that all of it may take; None for no limit.
    """
    request = pb.ReadPointsRequest(name=name, min_revision=min_revision)
    info: HullInfo | None = None

    def decode(part: pb.ReadPointsResponse) -> Stored:
        nonlocal info
        if info is None or part.HasField("hull"):
            info = messages.decode_info(part.hull)
        return messages.decode_stored(part, info)

    return Call("ReadPoints", request, decode, timeout)


def count(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Counted]:
    """The multiplicity of each of (n, 2) points; 0 for a point that the hull does not hold."""
    request = pb.CountRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.CountResponse) -> Counted:
        return Counted(response.revision, np.array(response.counts, np.int64))

    return Call("Count", request, decode, timeout)


def support(
    name: str,
    directions: npt.ArrayLike,
    *,
    keys: bool = False,
    layer: int = 1,
    min_revision: int = 0,
    timeout: float | None = None,
) -> Call[Supported]:
    """The extreme vertex in each of (n, 2) directions, which may have any length but 0. Exact.

    A direction of a geographic hull is east and north at its centre: (sin b, cos b) for a bearing b.

    With `keys`, also the key of each vertex, in a keyed hull. `layer` as for `locate`. HullEmptyError if the hull has
    no points.
    """
    vectors = encoded(directions, "directions")
    request = pb.SupportRequest(
        name=name, min_revision=min_revision, directions=vectors, include_keys=keys, layer=encode_layer(layer)
    )

    def decode(response: pb.SupportResponse) -> Supported:
        named = decode_names(response.keys) if keys else None
        return Supported(response.revision, messages.decode_points(response.vertices), named)

    return Call("Support", request, decode, timeout)


def tangents(
    name: str, xy: npt.ArrayLike, *, layer: int = 1, min_revision: int = 0, timeout: float | None = None
) -> Call[Tangents]:
    """The left and right tangent points of each of (n, 2) points; NaN for points not strictly outside. Exact.

    The points of a question about a geographic hull are within 85 degrees of its centre. `layer` as for `locate`.
    """
    request = pb.TangentsRequest(
        name=name, min_revision=min_revision, points=encoded(xy, "xy"), layer=encode_layer(layer)
    )

    def decode(response: pb.TangentsResponse) -> Tangents:
        left, right = messages.decode_points(response.left), messages.decode_points(response.right)
        return Tangents(response.revision, np.stack((left, right), axis=1))

    return Call("Tangents", request, decode, timeout)


def distance(
    name: str,
    xy: npt.ArrayLike | None = None,
    *,
    keys: Any = None,
    keys_of: str = "",
    keys_min_revision: int = 0,
    layer: int = 1,
    min_revision: int = 0,
    timeout: float | None = None,
) -> Call[Distances]:
    """The distance of each of (n, 2) points to the hull: 0 inside and on the boundary, inf if the hull is empty.

    Of a geographic hull in metres, on WGS 84, within a micrometre.

    Arguments as for `locate`; a missing key has the distance NaN.
    """
    request = pb.DistanceRequest(name=name, min_revision=min_revision, layer=encode_layer(layer))
    _ask_about(request, xy, keys, keys_of, keys_min_revision)

    def decode(response: pb.DistanceResponse) -> Distances:
        distances = np.array(response.distances, np.float64)
        return Distances(response.revision, distances, response.keys_revision if keys_of else None)

    return Call("Distance", request, decode, timeout)


def _ask_about(
    request: pb.LocateRequest | pb.DistanceRequest,
    xy: npt.ArrayLike | None,
    keys: Any,
    keys_of: str,
    keys_min_revision: int,
) -> None:
    """Add the points, or the keys whose positions are asked about."""
    if (xy is None) == (keys is None):
        raise ValueError("give either points or keys")
    if keys is None and (keys_of or keys_min_revision):
        raise ValueError("keys_of and keys_min_revision are given with keys")
    if xy is not None:
        request.points.CopyFrom(encoded(xy, "xy"))
        return
    request.keys.CopyFrom(encode_keys(checked_keys(keys)))
    request.keys_of, request.keys_min_revision = keys_of, keys_min_revision


def intersect_lines(
    name: str,
    p: npt.ArrayLike,
    q: npt.ArrayLike,
    *,
    layer: int = 1,
    min_revision: int = 0,
    timeout: float | None = None,
) -> Call[Crossings]:
    """The points where the line through each of (n, 2) p and q enters and leaves the hull; NaN if it misses.

    Lines of a geographic hull are great circles, through places within 85 degrees of its centre. `layer` as for
    `locate`.
    """
    request = pb.IntersectLinesRequest(
        name=name,
        min_revision=min_revision,
        origins=encoded(p, "p"),
        targets=encoded(q, "q"),
        layer=encode_layer(layer),
    )

    def decode(response: pb.IntersectLinesResponse) -> Crossings:
        entries, exits = messages.decode_points(response.entries), messages.decode_points(response.exits)
        return Crossings(response.revision, np.stack((entries, exits), axis=1))

    return Call("IntersectLines", request, decode, timeout)


def get_hull(name: str, *, layer: int = 1, min_revision: int = 0, timeout: float | None = None) -> Call[Hull]:
    """The vertices with their keys, size, area, perimeter, centroid and bounds; `layer` as for `locate`."""
    request = pb.GetHullRequest(name=name, min_revision=min_revision, include_keys=True, layer=encode_layer(layer))
    return Call("GetHull", request, messages.decode_hull, timeout)


def sample_points(
    name: str, size: int = 1000, *, keys: bool = False, min_revision: int = 0, timeout: float | None = None
) -> Call[Sampled]:
    """A sample of at most `size` points, and never more than 100 000; all points if there are no more.

    Inserting or deleting a point changes at most one point of the sample. With `keys`, also the key of each point, in a
    keyed hull.
    """
    request = pb.SamplePointsRequest(name=name, sample_size=size, min_revision=min_revision, include_keys=keys)

    def decode(response: pb.SamplePointsResponse) -> Sampled:
        named = decode_names(response.keys) if keys else None
        return Sampled(response.revision, messages.decode_points(response.points), named)

    return Call("SamplePoints", request, decode, timeout)


def verify(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[Verification]:
    """Compare the live hull with one that Chan's algorithm computes from the stored points.

    The fences that compare its keys, or it as a whole, are compared with positions and areas, too, and their events
    with each other.
    """
    request = pb.VerifyRequest(name=name, min_revision=min_revision)
    return Call("Verify", request, messages.decode_verification, timeout)


@dataclass(frozen=True, slots=True)
class Ingesting:
    """An ingest to begin."""

    name: str
    missing: Missing | None
    timeout: float | None

    def first(self) -> pb.IngestRequest:
        """The first message, which only names the hull: a wrong name fails before the first batch."""
        return pb.IngestRequest(name=self.name)

    def batch(self, **changes: Any) -> pb.IngestRequest:
        """The message for a batch."""
        return pb.IngestRequest(batch=Batch(**changes, missing=self.missing).message)


def ingest(name: str, *, missing: Missing | None = None, timeout: float | None = None) -> Ingesting:
    """A stream of batches in one call, for use in a with statement. `missing` as for `apply` and `remove`.

    >>> from dynhull_client import HullClient
    >>> client = HullClient()  # doctest: +SKIP
    >>> with client.ingest("fleet") as stream:  # doctest: +SKIP
    ...     for minute in minutes:
    ...         stream.apply(move=(before, after))
    >>> stream.summary.batches  # doctest: +SKIP
    1440
    """
    return Ingesting(name, missing, timeout)


@dataclass(frozen=True, slots=True)
class Writing:
    """A writer to open."""

    name: str
    producer: str
    batch_points: int
    linger: float
    in_flight: int
    missing: Missing | None
    coalesce: Literal["last"] | None
    stop_on_error: bool
    patience: float
    may_skip: bool
    uid: str
    acknowledged: int


def writer(
    name: str,
    *,
    producer: str | None = None,
    batch_points: int = 8192,
    linger: float = 0.02,
    in_flight: int = 32,
    missing: Missing | None = None,
    coalesce: Literal["last"] | None = None,
    stop_on_error: bool = False,
    patience: float = 60.0,
    may_skip: bool = False,
    uid: str = "",
    acknowledged: int = 0,
) -> Writing:
    """A writer that gathers points into batches, each applied exactly once.

    >>> from dynhull_client import HullClient
    >>> client = HullClient()  # doctest: +SKIP
    >>> with client.writer("fleet") as writer:  # doctest: +SKIP
    ...     for before, after in moves:
    ...         writer.put(move=(before, after))

    Without a with statement, end with `close()`: points that were not sent by then are lost otherwise. The writer needs
    memory for about `in_flight + 1` batches: `put` waits while that many are not acknowledged.

    Args:
        name: the hull.
        producer: a name for the sender that numbers the batches; by default a new one. A writer with the name of an
            earlier one continues after the last batch that was acknowledged. Two writers at the same time must not
            share a name.
        batch_points: a batch is sent when it has this many points,
        linger: or this many seconds after its first point.
        in_flight: the most batches that are sent and not acknowledged.
        missing: as for `apply` and `remove`.
        coalesce: "last" keeps only the last of several positions of a key in a batch; None begins a new batch where a
            key comes again.
        stop_on_error: whether a refused batch ends the writer; otherwise the batches after it are still applied.
        patience: seconds without a server after which the writer gives up.
        may_skip: whether the caller numbers what it puts, as with the offsets of a log: numbers that rise and may skip.
            The batch of several puts has the number of the last one, so the writer's `sequence` is where to continue
            after a restart. If another writer with the name has applied batches in the meantime, this one ends with
            SequenceGapError. Needs a `producer`.
        uid: the uid of the hull that an earlier writer with this name wrote to: RestoredError if a backup of the hull
            was restored since then. A writer also ends with that error if that happens while it writes.
        acknowledged: the number of the last batch that was acknowledged to that writer: the same error if the hull of
            this `uid` lacks it, as where nobody has noticed that the disk of the server was led back.
    """
    if may_skip and producer is None:
        raise ValueError("may_skip needs a producer, whose numbers go on after a restart")
    positive("batch_points", batch_points)
    positive("in_flight", in_flight)
    producer = f"writer-{uuid4().hex}" if producer is None else producer
    if coalesce not in (None, "last"):
        raise ValueError(f'coalesce must be None or "last", got {coalesce!r}')
    return Writing(
        name,
        producer,
        batch_points,
        linger,
        in_flight,
        missing,
        coalesce,
        stop_on_error,
        patience,
        may_skip,
        uid,
        acknowledged,
    )


@dataclass(frozen=True, slots=True)
class Piping:
    """A pipeline to open."""

    batch_reads: int
    in_flight: int


def pipeline(*, batch_reads: int = 256, in_flight: int = 4096) -> Piping:
    """Many reads in few messages: each method returns the future of its answer, and the answers come in order.

    >>> from dynhull_client import HullClient
    >>> client = HullClient()  # doctest: +SKIP
    >>> with client.pipeline() as pipeline:  # doctest: +SKIP
    ...     answers = [pipeline.locate("fleet", [position]) for position in positions]
    >>> answers[0].result().sides  # doctest: +SKIP

    Reads are sent as soon as the connection takes them: alone where there are few, many in a message where there are
    many.

    Args:
        batch_reads: the most reads of a message.
        in_flight: the most reads that are sent and not answered. As many more may wait to be sent.
    """
    positive("batch_reads", batch_reads)
    positive("in_flight", in_flight)
    return Piping(batch_reads, in_flight)


@dataclass(frozen=True, slots=True)
class Watching:
    """A watch, or a replay, to begin."""

    request: pb.WatchRequest | pb.ReplayRequest
    copy: HullCopy | None
    follow: bool
    reconnect: bool
    timeout: float | None


def watch(
    name: str,
    *,
    min_revision: int = 0,
    max_rate: float = 0.0,
    progress_interval: float | None = None,
    measures: bool = False,
    copy: HullCopy | None = None,
    resume: HullCopy | None = None,
    directions: npt.ArrayLike | None = None,
    keys: bool = False,
    outline: bool = False,
    layer: int = 1,
    max_vertices: int | None = None,
    follow: bool = False,
    reconnect: bool = True,
    timeout: float | None = None,
) -> Watching:
    """Follow a hull: an iterator of events, from which a `HullCopy` maintains a copy of the hull.

    >>> from dynhull_client import HullClient, HullCopy
    >>> client, copy = HullClient(), HullCopy()  # doctest: +SKIP
    >>> for event in client.watch("fleet", copy=copy):  # doctest: +SKIP
    ...     print(event.revision, len(copy.vertices))

    Args:
        name: the hull.
        min_revision: the first event waits until the hull has reached it.
        max_rate: the most events a second, each with all changes since the one before; 0 for no limit. At
            least one a day.
        progress_interval: seconds without an event after which a Progress is sent; None for never or, with a copy that
            has a `max_staleness`, for a third of it.
        measures: whether events include measures.
        copy: a copy that the watch itself updates before it returns an event. If the copy holds the hull already, the
            watch continues from there.
        resume: a copy that the caller updates: the watch begins with the changes since then, not with a snapshot.
        directions: (k, 2) vectors; the watch then sends no vertices but `Sketch` events with the extreme vertices in
            these directions.
        keys: whether events name the vertices, in a keyed hull; `HullCopy.vertex_keys` then has their keys.
        outline: whether there are events only when the vertices change (or, with `keys`, their names), not for every
            revision. A Progress then says that they have not changed up to its revision.
        layer: the convex layer to follow, as for `locate`. Its watch begins with a Snapshot after each lost connection.
        max_vertices: send `Sketch` events with at most this many of the vertices, from 1 to 1000, and with how far the
            hull reaches beyond them, for hulls too large to send.
        follow: whether the watch survives the deletion of the hull: it returns a `Deleted` event, and a Snapshot when
            there is a new hull of that name. It also waits for a hull that does not exist yet. Without it,
            HullNotFoundError ends the watch.
        reconnect: whether the watch continues after a lost connection, however long that takes, with the changes since
            then, or with a snapshot if the server no longer has them. Without it, UnavailableError ends the watch, as
            does RevisionForgottenError if the server cannot continue from a copy. Until the first event it is tried
            again as other reads are (`retries` of the client), in both cases.
        timeout: seconds after which the watch ends with DeadlineError; None for never.
    """
    request = pb.WatchRequest(
        name=name,
        min_revision=min_revision,
        max_events_per_second=max_rate,
        include_measures=measures,
        include_keys=keys,
        outline_only=outline,
        layer=encode_layer(layer),
        max_vertices=positive("max_vertices", max_vertices),
    )
    if copy is not None and resume is not None:
        raise ValueError("give either copy, which the watch updates, or resume, which the caller updates, not both")
    held = copy if copy is not None and copy.uid else resume
    if held is not None and resumable(request):
        request.resume.uid, request.resume.revision = held.uid, held.revision
    if directions is not None:
        request.directions.CopyFrom(encoded(directions, "directions"))
    kept = copy if copy is not None else resume
    encode_progress(request, progress_interval, kept)
    return Watching(request, copy, follow, reconnect, timeout)


def encode_progress(request: pb.WatchRequest | pb.ReplayRequest, interval: float | None, copy: HullCopy | None) -> None:
    """How often nothing new is said; by default as often as a copy with a `max_staleness` needs it."""
    if interval is None and copy is not None and copy.max_staleness is not None:
        interval = copy.max_staleness / MARKS
    if interval is not None:
        request.progress_interval.CopyFrom(encode_duration(interval, "progress_interval"))


def resumable(request: pb.WatchRequest) -> bool:
    """Whether a watch may continue from what it has received, rather than begin anew."""
    return not (request.HasField("directions") or request.layer or request.max_vertices)


def encoded(xy: npt.ArrayLike, name: str) -> points_pb2.Points:
    """Points in the form of a message; ValueError or TypeError names the argument and the first bad row."""
    return messages.encode_points(as_points(xy, name, on_globe=None))
