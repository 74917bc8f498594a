"""The calls about fences: the request, how to read the answer, and the documentation."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any

import grpc

from dynhull.arrays import as_coordinate
from dynhull_proto.v1 import fence_pb2
from dynhull_proto.v1 import fence_service_pb2 as pb
from dynhull_surface.settings import FenceSettings

from ._areas import Prefix, as_area, encode_area
from ._arguments import flag, text, whole
from ._calls import Call, Pages
from ._errors import FenceExistsError, FenceNotFoundError
from ._fence_messages import (
    Fence,
    FenceConsumer,
    Inside,
    decode_consumer,
    decode_fence,
    decode_inside,
)
from ._keys import checked_keys, encode_keys
from ._numbered_place import encode_start
from ._settings import SPAN, documenting_settings, encode_settings

if TYPE_CHECKING:
    from datetime import timedelta

    from dynhull_surface.settings import Boundary, Initial

# What an existing fence has in common with the one to create.
COMPARED = [each.name for each in fields(FenceSettings) if each.name not in ("name", "initial")]


@documenting_settings(FenceSettings, SPAN)
def create_fence(  # noqa: D417  # the settings have their descriptions
    name: str,
    area: Any,
    subjects: str | Prefix | None = None,
    *,
    other_hull: str | None = None,
    boundary: Boundary = "closed",
    margin: float = 0.0,
    initial: Initial = "snapshot",
    crosses: bool = False,
    dwell: float | timedelta | str | None = None,
    confirmations: int = 0,
    min_dwell: float | timedelta | str | None = None,
    by_accuracy: bool = False,
    expected: Any = None,
    expected_by: str | None = None,
    expected_within: float | timedelta | str | None = None,
    near: float = 0.0,
    without_self: bool = False,
    layer: int = 1,
    max_events: int = 0,
    max_event_age: float | timedelta | str | None = None,
    exist_ok: bool = False,
    timeout: float | None = None,
) -> Call[Fence]:
    """Create a fence: it compares subjects with an area, and makes an event when one enters or leaves, whoever moves.

    >>> client.create_fence("depot", area=[[0, 0], [4, 0], [4, 3]], subjects="vehicles")  # doctest: +SKIP

    FenceExistsError if a fence has that name; HullNotFoundError if there is no such hull.

    Args:
        name: 1 to 200 letters a to z and A to Z, digits and "._-/". A hull may have the same name.
        area: the name of a hull, whose area moves as its points do; or a polygon: (n, 2) corners, a `Polygon` with
            holes, GeoJSON, WKT (with shapely), a geometry with `__geo_interface__`, or a list of these, joined by "or";
            or a `Circle`.
        subjects: the keyed hull whose keys are compared; or a `Prefix` for all keyed hulls with such names,
        other_hull: or a hull that is compared as a whole, with an area that is a hull.
        expected: keys that should be inside by `expected_by` or `expected_within`, as for `put`; None for none.
        SETTINGS
        exist_ok: whether to return an existing fence of that name and with these settings. FenceExistsError if it has
            others, or without `exist_ok`.
        timeout: seconds, instead of the client's.
    """
    config = encode_fence(locals())
    create: Call[Fence] = Call(
        "CreateFence",
        pb.CreateFenceRequest(name=text("name", name), config=config),
        lambda response: decode_fence(response.fence),
        timeout,
        repeatable=exist_ok,
        instead=lambda error: existing if exist_ok and isinstance(error, FenceExistsError) else None,
    )
    wanted = decode_fence(fence_pb2.Fence(name=name, config=config))
    existing: Call[Fence] = Call(
        "GetFence",
        pb.GetFenceRequest(name=text("name", name)),
        lambda response: _as_wanted(decode_fence(response.fence), wanted),
        timeout,
        instead=lambda error: create if isinstance(error, FenceNotFoundError) else None,  # deleted in the meantime
    )
    return create


def replace_fence(
    name: str,
    area: Any,
    subjects: str | Prefix | None = None,
    *,
    other_hull: str | None = None,
    boundary: Boundary = "closed",
    margin: float = 0.0,
    crosses: bool = False,
    dwell: float | timedelta | str | None = None,
    confirmations: int = 0,
    min_dwell: float | timedelta | str | None = None,
    by_accuracy: bool = False,
    expected: Any = None,
    expected_by: str | None = None,
    expected_within: float | timedelta | str | None = None,
    near: float = 0.0,
    without_self: bool = False,
    layer: int = 1,
    max_events: int = 0,
    max_event_age: float | timedelta | str | None = None,
    timeout: float | None = None,
) -> Call[Fence]:
    """Replace the area and the settings of a fence; the subjects must stay the same. Arguments as for `create_fence`.

    Subjects that are inside of one area and outside of the other make events with the cause "fence_changed". The same
    settings again make none.
    """
    request = pb.ReplaceFenceRequest(name=text("name", name), config=encode_fence(locals()))
    return Call("ReplaceFence", request, lambda response: decode_fence(response.fence), timeout)


def delete_fence(name: str, *, timeout: float | None = None) -> Call[None]:
    """Delete a fence and its events. Its watches get a last event, "closed", and end."""
    return Call(
        "DeleteFence", pb.DeleteFenceRequest(name=text("name", name)), lambda _: None, timeout, repeatable=False
    )


def get_fence(name: str, *, timeout: float | None = None) -> Call[Fence]:
    """A fence with its settings, its counts and its consumers. FenceNotFoundError if there is none of that name."""
    return Call(
        "GetFence", pb.GetFenceRequest(name=text("name", name)), lambda response: decode_fence(response.fence), timeout
    )


def list_fences(prefix: str = "", *, timeout: float | None = None) -> Pages[Fence]:
    """The fences whose names begin with `prefix`, in the order of their names, fetched page by page."""
    text("prefix", prefix)

    def decode(response: pb.ListFencesResponse) -> tuple[list[Fence], str]:
        return [decode_fence(each) for each in response.fences], response.next_page_token

    return lambda token: Call("ListFences", pb.ListFencesRequest(prefix=prefix, page_token=token), decode, timeout)


def fence_inside(name: str, *, timeout: float | None = None) -> Call[Inside]:
    """The subjects that are inside, all at one moment."""
    return Call("ReadInside", pb.ReadInsideRequest(name=text("name", name)), decode_inside, timeout, in_parts=True)


def ack_fence(
    name: str, consumer: str, sequence: int, *, uid: str = "", timeout: float | None = None
) -> Call[FenceConsumer]:
    """Acknowledge the events of a fence up to a sequence. A sequence before the acknowledged one changes nothing.

    Args:
        name: the fence.
        consumer: the name of the consumer, which is created if it is new.
        sequence: the last sequence that has been processed.
        uid: the uid of the fence that made the event: FenceReplacedError if it was created again since then.
        timeout: seconds, instead of the client's.
    """
    request = pb.AckFenceRequest(
        name=text("name", name),
        consumer=text("consumer", consumer),
        sequence=whole("sequence", sequence),
        uid=text("uid", uid),
    )
    return Call("AckFence", request, lambda response: decode_consumer(response.consumer), timeout)


def delete_consumer(name: str, consumer: str, *, timeout: float | None = None) -> Call[None]:
    """Delete a consumer of a fence. What it has not acknowledged no longer counts as its backlog."""
    request = pb.DeleteConsumerRequest(name=text("name", name), consumer=text("consumer", consumer))
    return Call("DeleteConsumer", request, lambda _: None, timeout, repeatable=False)


@dataclass(frozen=True, slots=True)
class WatchingFence:
    """A watch of a fence to begin."""

    request: pb.WatchFenceRequest
    reconnect: bool
    timeout: float | None


def watch_fence(
    name: str,
    consumer: str | None = None,
    after: int | None = None,
    *,
    uid: str = "",
    conflate: bool = False,
    max_rate: float = 0.0,
    progress_interval: float | None = None,
    reconnect: bool = True,
    timeout: float | None = None,
) -> WatchingFence:
    """Follow the events of a fence: an iterator that ends after the event "closed", when the fence is deleted.

    >>> for event in client.watch_fence("depot", consumer="alarm"):  # doctest: +SKIP
    ...     print(event.type, event.key)
    ...     client.ack_fence("depot", "alarm", event.sequence)

    It begins with the next event, unless a consumer or a sequence says where.

    Args:
        name: the fence.
        consumer: the name of a durable consumer: the watch begins after the last event that it acknowledged, and for a
            new consumer at the oldest event that is kept. The consumer outlives clients and servers; `ack_fence`
            acknowledges.
        after: the sequence after which to begin; 0 for all events that are kept.
        uid: the uid of the fence whose sequences the caller has: FenceReplacedError if it was created again since then.
        conflate: leave out events that cancel each other in what is sent together; not with a consumer. A later watch
            continues after the attribute `after` of an event, not after its sequence.
        max_rate: the most responses a second, each with all events since the one before; 0 for no limit. At
            least one a day.
        progress_interval: seconds without an event after which an event "progress" is sent; None for never.
        reconnect: whether the watch continues after a lost connection, however long that takes, without loss or
            repetition. Without it, UnavailableError ends the watch. Until it has begun it is tried again as other
            reads are (`retries` of the client), in both cases.
        timeout: seconds after which the watch ends with DeadlineError; None for never.
    """
    if consumer is not None and after is not None:
        raise ValueError("give either consumer, which knows its place, or after, not both")
    if consumer is not None and conflate:
        raise ValueError("conflate is for a watch without a consumer")
    request = pb.WatchFenceRequest(
        name=text("name", name),
        uid=text("uid", uid),
        conflate=flag("conflate", conflate),
        max_responses_per_second=as_coordinate(max_rate, "max_rate"),
    )
    encode_start(request, consumer, after, progress_interval)
    return WatchingFence(request, reconnect, timeout)


def encode_fence(given: dict[str, Any]) -> fence_pb2.FenceConfig:
    """The settings of a fence, given the arguments of a call by name: `create_fence` says what each of them is."""
    subjects, other_hull = given["subjects"], given["other_hull"]
    if (subjects is None) == (other_hull is None):
        raise ValueError("give either subjects or other_hull")
    if given["expected_by"] is not None and given["expected_within"] is not None:
        raise ValueError("give either expected_by or expected_within, not both")
    config = fence_pb2.FenceConfig()
    encode_area(as_area(given["area"]), config)
    if given["confirmations"] == 1:  # each report agrees with itself
        given["confirmations"] = 0
    encode_settings(FenceSettings, given, config)
    if given["expected"] is not None:
        config.expected.CopyFrom(encode_keys(checked_keys(given["expected"], "expected")))
    if isinstance(subjects, Prefix):
        config.subject_prefix = text("subjects", subjects.text)
    elif subjects is not None:
        config.subject_hull = text("subjects", subjects)
    else:
        config.other_hull = text("other_hull", other_hull)
    return config


def _as_wanted(existing: Fence, wanted: Fence) -> Fence:
    """The existing fence; FenceExistsError if it has other settings than the one to create."""
    for setting in COMPARED:
        has, wants = getattr(existing, setting), getattr(wanted, setting)
        if has != wants:
            message = f"the fence {existing.name!r} exists with other settings: its {setting} is {has!r}, not {wants!r}"
            raise FenceExistsError(message, grpc.StatusCode.ALREADY_EXISTS, "FENCE_EXISTS", {"value": existing.name})
    return existing
