"""Conversion of values to messages."""

from collections.abc import Awaitable, Callable
from datetime import timedelta
from functools import partial
from itertools import compress
from operator import attrgetter
from typing import assert_never

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import PackedKeys
from dynhull_proto.v1 import batch_pb2, hull_pb2, hull_service_pb2, points_pb2
from dynhull_surface.counts import COUNTS

from ..engine.difference import Difference
from ..engine.layers import Layers
from ..engine.live_hull import LiveHull
from ..engine.measures import HullMeasures
from ..engine.series import Series
from ..engine.steps import BLOCK, Run
from ..engine.verification import Verification
from ..engine.views import Change, Event, Progress, Sketch, Snapshot
from ..state.batch import NO_POINTS, Applied
from ..state.contents.keyed import Found
from ..state.fences.model.faults import FenceFault
from ..state.hull_state import Counts, VertexKeys
from ..state.records import (
    FOREVER,
    NO_TIME,
    Accuracies,
    Cause,
    Center,
    Contents,
    Frame,
    HeldRows,
    HullSettings,
    Identity,
    Keys,
    QuarantineRules,
    Times,
)
from ..storage.past import Erasure, StoredHistory

# Makes the measures of some vertices.
Measure = Callable[[Points], Awaitable[HullMeasures]]

IDENTITIES: dict[Identity, hull_pb2.Identity] = {
    "multiset": hull_pb2.IDENTITY_MULTISET,
    "str": hull_pb2.IDENTITY_STRING_KEYS,
    "int": hull_pb2.IDENTITY_INTEGER_KEYS,
}


CAUSES: dict[Cause | None, batch_pb2.Cause] = {
    None: batch_pb2.CAUSE_UNSPECIFIED,
    "batch": batch_pb2.CAUSE_BATCH,
    "expiry": batch_pb2.CAUSE_EXPIRY,
    "recenter": batch_pb2.CAUSE_RECENTER,
    "quarantine": batch_pb2.CAUSE_BATCH,
    "division": batch_pb2.CAUSE_BATCH,
}

# The counts of keys and times; the rows that are held are listed, too.
MORE = tuple(name for name in COUNTS if name not in ("inserted", "deleted", "missing", "held"))
more_of = attrgetter(*MORE)

FRAMES: dict[Frame, hull_pb2.Frame] = {"plane": hull_pb2.FRAME_PLANE, "geographic": hull_pb2.FRAME_GEOGRAPHIC}


def encode_points(xy: Points, encoding: points_pb2.PointEncoding) -> points_pb2.Points:
    """Points in the given encoding."""
    if encoding == points_pb2.POINT_ENCODING_COORDINATES:
        return points_pb2.Points(coordinates=xy.ravel().tolist())
    return points_pb2.Points(packed=np.asarray(xy, "<f8").tobytes())


def encode_keys(keys: Keys, encoding: points_pb2.PointEncoding) -> points_pb2.Keys:
    """Keys: packed, or as lists where points are lists of coordinates."""
    lists = encoding == points_pb2.POINT_ENCODING_COORDINATES
    if not isinstance(keys, PackedKeys):
        if lists:
            return points_pb2.Keys(integers=keys.tolist())
        return points_pb2.Keys(packed_integers=keys.astype("<u8", copy=False).tobytes())
    return points_pb2.Keys(strings=keys) if lists else points_pb2.Keys(lengths=keys.lengths, text=keys.data)


def key_sequence(keys: VertexKeys) -> Keys:
    """Keys in an array of str or of uint64, packed if they are strings."""
    return PackedKeys.pack(keys.tolist()) if keys.dtype == object else keys


def encode_key_array(keys: VertexKeys, encoding: points_pb2.PointEncoding) -> points_pb2.Keys:
    """Keys in an array of str or of uint64."""
    return encode_keys(key_sequence(keys), encoding)


def encode_times(times: Times, encoding: points_pb2.PointEncoding) -> points_pb2.Times:
    """Times: packed, or as timestamps where points are lists of coordinates; NO_TIME becomes 1970-01-01T00:00:00Z."""
    known = np.where(times == NO_TIME, 0, times)
    if encoding != points_pb2.POINT_ENCODING_COORDINATES:
        return points_pb2.Times(packed=known.astype("<i8", copy=False).tobytes())
    message = points_pb2.Times()
    for time in known.tolist():
        message.timestamps.add().FromMicroseconds(time)
    return message


def encode_accuracies(accuracies: Accuracies, encoding: points_pb2.PointEncoding) -> points_pb2.Accuracies:
    """Accuracies: packed, or as a list where points are lists of coordinates."""
    if encoding != points_pb2.POINT_ENCODING_COORDINATES:
        return points_pb2.Accuracies(packed=accuracies.astype("<f8", copy=False).tobytes())
    return points_pb2.Accuracies(values=accuracies.tolist())


def encode_settings(settings: HullSettings, shards: int) -> hull_pb2.HullConfig:
    """The settings of a hull that has this number of shards."""
    config = hull_pb2.HullConfig(
        identity=IDENTITIES[settings.identity],
        max_points=settings.max_points,
        frame=FRAMES[settings.frame],
        center=encode_center(settings.center),
        quarantine=encode_quarantine(settings.quarantine),
        shards=shards,
        history=encode_history(settings),
    )
    if settings.identity != "multiset":
        by_time = settings.by_event_time
        config.ordering = hull_pb2.ORDERING_EVENT_TIME if by_time else hull_pb2.ORDERING_ARRIVAL
    window = settings.window
    if window is None:
        return config
    if window.max_age:
        config.window.max_age.FromMicroseconds(window.max_age)
    config.window.max_points = window.max_points
    config.window.clock = hull_pb2.CLOCK_DATA if window.clock == "data" else hull_pb2.CLOCK_SERVER
    if window.max_skew is not None:
        config.window.max_skew.FromMicroseconds(window.max_skew)
        config.window.ahead = hull_pb2.AHEAD_POLICY_CLAMP if window.clamps else hull_pb2.AHEAD_POLICY_REFUSE
    return config


def encode_history(settings: HullSettings) -> hull_pb2.History | None:
    """Which of its past a hull keeps; None for nothing."""
    if not settings.history:
        return None
    message = hull_pb2.History(max_bytes=settings.history_bytes)
    if settings.history != FOREVER:
        message.max_age.FromMicroseconds(settings.history)
    return message


def encode_erasure(erasure: Erasure) -> hull_pb2.Erasure:
    """What was erased from the past of a hull."""
    message = hull_pb2.Erasure(
        first_revision=erasure.first, last_revision=erasure.last, keys=erasure.keys, moves=erasure.moves
    )
    message.time.FromMicroseconds(erasure.time)
    return message


def encode_found_history(hull: LiveHull, found: StoredHistory) -> hull_service_pb2.GetHistoryResponse:
    """What is there of the past of a hull."""
    message = hull_service_pb2.GetHistoryResponse(
        history=encode_history(hull.settings),
        first_revision=found.first.revision,
        last_revision=found.last.revision,
        bytes=found.bytes,
        batches=found.batches,
        moves=found.moves,
        erasures=[encode_erasure(each) for each in found.erasures],
    )
    if found.first.committed is not None:
        message.first_time.FromMicroseconds(found.first.committed.time)
    if found.last.committed is not None:
        message.last_time.FromMicroseconds(found.last.committed.time)
    return message


def encode_center(center: Center | None) -> hull_pb2.LonLat | None:
    """The centre of a hull, if it has one."""
    return None if center is None else hull_pb2.LonLat(longitude=center[0], latitude=center[1])


def encode_quarantine(rules: QuarantineRules | None) -> hull_pb2.Quarantine | None:
    """The rules of a quarantine; None for a hull that has never had any."""
    if rules is None:
        return None
    return hull_pb2.Quarantine(
        max_speed=rules.max_speed, max_growth=rules.max_growth, confirmations=rules.confirmations
    )


def encode_hull(hull: LiveHull, counts: Counts) -> hull_pb2.Hull:
    """A hull with its counts at one revision."""
    message = hull_pb2.Hull(
        name=hull.name,
        config=encode_settings(hull.settings, counts.shards),
        revision=counts.revision,
        point_count=counts.points,
        distinct_point_count=counts.distinct,
        uid=hull.uid,
        center=encode_center(counts.center),
        quarantine=encode_quarantine(counts.rules),
        held_count=counts.held,
        erased=hull.erased,
    )
    message.create_time.FromDatetime(hull.created)
    if counts.clock is not None:
        message.clock_time.FromMicroseconds(counts.clock)
    encode_changed(hull, message)
    return message


def encode_changed(hull: LiveHull, message: hull_pb2.Hull | hull_service_pb2.WatchResponse) -> None:
    """Write when a hull changed last."""
    if hull.committed is not None:
        message.changed_time.FromMicroseconds(hull.committed.time)


def encode_positions(
    counts: Counts, found: Found, encoding: points_pb2.PointEncoding
) -> hull_service_pb2.GetPositionsResponse:
    """The positions of keys."""
    return hull_service_pb2.GetPositionsResponse(
        revision=counts.revision,
        positions=encode_points(found.points, encoding),
        present=found.present.tobytes(),
        times=None if found.times is None else encode_times(found.times, encoding),
        accuracies=None if found.accuracies is None else encode_accuracies(found.accuracies, encoding),
    )


def encode_entities(
    counts: Counts, entities: Contents, rows: slice, encoding: points_pb2.PointEncoding
) -> hull_service_pb2.ReadEntitiesResponse:
    """Some rows of the keys of a hull with their positions."""
    assert entities.keys is not None  # those of a keyed hull
    times = None if entities.times is None else encode_times(entities.times[rows], encoding)
    return hull_service_pb2.ReadEntitiesResponse(
        revision=counts.revision,
        keys=encode_keys(entities.keys[rows], encoding),
        positions=encode_points(entities.points[rows], encoding),
        times=times,
        accuracies=None if entities.accuracies is None else encode_accuracies(entities.accuracies[rows], encoding),
    )


def encode_part(
    counts: Counts, contents: Contents, rows: slice, encoding: points_pb2.PointEncoding
) -> hull_service_pb2.ReadPointsResponse:
    """Some rows of the points of a hull."""
    part = hull_service_pb2.ReadPointsResponse(
        revision=counts.revision,
        points=encode_points(contents.points[rows], encoding),
        keys=None if contents.keys is None else encode_keys(contents.keys[rows], encoding),
    )
    if contents.times is not None:
        times = contents.times[rows]
        part.times.CopyFrom(encode_times(times, encoding))
        part.timed = _which(times != NO_TIME)
    if contents.deadlines is not None:
        known = contents.deadlines[rows] != FOREVER
        part.expire_times.CopyFrom(encode_times(np.where(known, contents.deadlines[rows], NO_TIME), encoding))
        part.expires = _which(known)
    if contents.accuracies is not None:
        part.accuracies.CopyFrom(encode_accuracies(contents.accuracies[rows], encoding))
    return part


def _which(rows: npt.NDArray[np.bool_]) -> bytes:
    """A byte for each row, 1 for those that are meant; none if all are."""
    return b"" if rows.all() else rows.tobytes()


def encode_held(
    counts: Counts, held: HeldRows, token: str, encoding: points_pb2.PointEncoding
) -> hull_service_pb2.ListHeldResponse:
    """A page of the positions in quarantine; `token` is that of the next page."""
    timed = bool((held.times != NO_TIME).any())
    return hull_service_pb2.ListHeldResponse(
        revision=counts.revision,
        keys=encode_keys(held.keys, encoding),
        positions=encode_points(held.points, encoding),
        times=encode_times(held.times, encoding) if timed else None,
        speeds=held.speeds.tolist(),
        growths=held.growths.tolist(),
        revisions=held.revisions.tolist(),
        confirmations=held.confirmed.tolist(),
        held_count=counts.held,
        next_page_token=token,
        accuracies=encode_accuracies(held.accuracies, encoding) if held.accuracies.any() else None,
    )


def encode_measures(found: HullMeasures) -> hull_pb2.Measures:
    """The message of measures."""
    min_x, min_y, max_x, max_y = found.bounds
    return hull_pb2.Measures(
        area=found.area,
        perimeter=found.perimeter,
        centroid_x=found.centroid[0],
        centroid_y=found.centroid[1],
        min_x=min_x,
        min_y=min_y,
        max_x=max_x,
        max_y=max_y,
        diameter=found.diameter,
        width=found.width,
    )


def encode_series(
    hull: LiveHull, series: Series, encoding: points_pb2.PointEncoding, interval: float
) -> hull_service_pb2.GetSeriesResponse:
    """The measures of the last time, about so many seconds apart; 0 where none are kept."""
    rows = series.rows
    message = hull_service_pb2.GetSeriesResponse(
        uid=hull.uid,
        frame=FRAMES["geographic" if hull.geographic else "plane"],
        times=encode_times(rows["time"], encoding),
        changed_times=encode_times(rows["changed"], encoding),
        revisions=rows["revision"].tolist(),
        point_counts=rows["points"].tolist(),
        vertex_counts=rows["vertices"].tolist(),
        areas=rows["area"].tolist(),
        perimeters=rows["perimeter"].tolist(),
        diameters=rows["diameter"].tolist(),
        widths=rows["width"].tolist(),
    )
    message.since_time.FromMicroseconds(series.since)
    if interval:
        message.interval.FromTimedelta(timedelta(seconds=interval))
    return message


def encode_applied(applied: Applied, result: batch_pb2.BatchResult) -> None:
    """Write the result of a batch into a message, field by field: twice as fast as copying a message."""
    result.revision = applied.revision
    result.point_count = applied.points
    if applied.hull_changed:
        result.hull_changed = True
    if applied.duplicate:
        result.duplicate = True
    if applied.inserted:
        result.inserted = applied.inserted
    if applied.deleted:
        result.deleted = applied.deleted
    if applied.missing:
        result.missing = applied.missing
    if applied.plain:
        return
    for name in compress(MORE, more_of(applied)):
        setattr(result, name, getattr(applied, name))
    if applied.held:
        result.held = len(applied.held)
        result.held_rows.extend(applied.held)
    if applied.clock is not None:
        result.clock_time.FromMicroseconds(applied.clock)


def add_counts(applied: Applied, summary: hull_service_pb2.IngestResponse) -> None:
    """Add the counts of a batch to those of an ingest."""
    summary.inserted += applied.inserted
    summary.deleted += applied.deleted
    summary.missing += applied.missing
    if applied.plain:
        return
    for name in compress(MORE, more_of(applied)):
        setattr(summary, name, getattr(summary, name) + getattr(applied, name))
    summary.held += len(applied.held)


def encode_change(
    removed: Points,
    vertices: Points,
    difference: Difference,
    keys: VertexKeys | None,
    encoding: points_pb2.PointEncoding,
) -> hull_service_pb2.HullChange:
    """The edit to `vertices`, which have `keys` if the watcher asked for them; `removed` are those that are lost."""
    change = hull_service_pb2.HullChange(
        removed=encode_points(removed, encoding),
        removed_indices=difference.removed.tolist(),
        added=encode_points(vertices[difference.added], encoding),
        added_indices=difference.added.tolist(),
        rotation=difference.rotation,
    )
    if keys is not None:
        change.added_keys.CopyFrom(encode_key_array(keys[difference.added], encoding))
        change.renamed_indices.extend(difference.renamed.tolist())
        change.renamed_keys.CopyFrom(encode_key_array(keys[difference.renamed], encoding))
    return change


def encode_event(event: Event, encoding: points_pb2.PointEncoding) -> hull_service_pb2.WatchResponse:
    """The message of an event, without measures."""
    counts = event.counts
    message = hull_service_pb2.WatchResponse(
        revision=counts.revision, point_count=counts.points, cause=CAUSES[counts.cause]
    )
    if counts.center is not None:
        message.center.longitude, message.center.latitude = counts.center
    if counts.clock is not None:
        message.clock_time.FromMicroseconds(counts.clock)
    match event:
        case Snapshot():
            message.snapshot.uid = event.uid
            message.snapshot.vertices.CopyFrom(encode_points(event.vertices, encoding))
            if event.keys is not None:
                message.snapshot.vertex_keys.CopyFrom(encode_key_array(event.keys, encoding))
        case Change():
            change = encode_change(event.removed, event.vertices, event.difference, event.keys, encoding)
            message.change.CopyFrom(change)
        case Progress():
            message.progress.SetInParent()
        case Sketch():
            message.sketch.uid = event.uid
            message.sketch.vertices.CopyFrom(encode_points(event.extremes, encoding))
            message.sketch.error = event.error
            if event.keys is not None:
                message.sketch.keys.CopyFrom(encode_key_array(event.keys, encoding))
        case _:
            assert_never(event)
    return message


async def encode_watched(
    event: Event, encoding: points_pb2.PointEncoding, run: Run, measure: Measure | None
) -> hull_service_pb2.WatchResponse:
    """The message of an event, with the measures of its vertices if it has them and `measure` makes them.

    `run` encodes large events, which would delay every other call.
    """
    message: hull_service_pb2.WatchResponse
    if _rows(event) > BLOCK:
        message = await run(partial(encode_event, event, encoding))
    else:
        message = encode_event(event, encoding)
    if measure is not None and not isinstance(event, Progress) and event.vertices is not None:
        message.measures.CopyFrom(encode_measures(await measure(event.vertices)))
    return message


def _rows(event: Event) -> int:
    """The number of points in the message of an event."""
    match event:
        case Snapshot():
            return len(event.vertices)
        case Change():
            return len(event.removed) + event.difference.added.size + event.difference.renamed.size
        case Progress():
            return 0
        case Sketch():
            return len(event.extremes)
        case _:
            assert_never(event)


def encode_layers(
    peeled: Layers, encoding: points_pb2.PointEncoding, *, keys: bool
) -> hull_service_pb2.GetLayersResponse:
    """Convex layers, and with `keys` those of their vertices if the hull is keyed."""
    named = peeled.keys if keys else None
    return hull_service_pb2.GetLayersResponse(
        revision=peeled.counts.revision,
        vertex_counts=map(len, peeled.layers),
        vertices=encode_points(np.concatenate([NO_POINTS, *peeled.layers]), encoding),
        vertex_keys=None if named is None else encode_key_array(_joined(named), encoding),
    )


def _joined(keys: list[VertexKeys]) -> VertexKeys:
    return np.concatenate(keys) if keys else np.empty(0, object)


def encode_verification(
    counts: Counts, verification: Verification, encoding: points_pb2.PointEncoding
) -> hull_service_pb2.VerifyResponse:
    """The outcome of a verification."""
    message = hull_service_pb2.VerifyResponse(
        revision=counts.revision,
        equal=verification.difference is None,
        point_count=verification.points,
        vertex_count=verification.vertices,
        keys_equal=verification.keys_equal,
        fence_count=verification.fences,
        fence_differences=map(_encode_fault, verification.fence_faults),
        rounds=[
            hull_service_pb2.ChanRound(
                guess=each.guess, groups=each.groups, steps=each.steps, cost=each.cost, closed=each.closed
            )
            for each in verification.rounds
        ],
    )
    if verification.difference is not None:
        message.first_difference.index = verification.difference.index
        message.first_difference.live.CopyFrom(encode_points(verification.difference.live, encoding))
        message.first_difference.recomputed.CopyFrom(encode_points(verification.difference.recomputed, encoding))
    return message


def _encode_fault(fault: FenceFault) -> hull_service_pb2.FenceDifference:
    message = hull_service_pb2.FenceDifference(
        fence=fault.fence,
        subject_hull=fault.hull,
        sequence=fault.sequence,
        expected=fault.expected,
        found=fault.found,
    )
    if isinstance(fault.key, str):
        message.string_key = fault.key
    elif fault.key is not None:
        message.integer_key = fault.key
    return message
