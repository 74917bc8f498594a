"""FenceService, one method per RPC of dynhull.v1. The .proto files document the methods."""

from collections.abc import Awaitable, Callable
from itertools import chain, repeat
from typing import TypeVar

from google.protobuf.message import Message

from dynhull_proto.v1 import alarm_service_pb2, fence_pb2
from dynhull_proto.v1 import fence_service_pb2 as pb

from ..engine.fences import Fences, LiveFence
from ..engine.past_fences import PastFences
from ..engine.watch_fence import Sent, watch_fence
from ..state.errors import FenceReplacedError, SequenceAheadError
from ..state.fences.model.config import FenceConfig
from ..state.fences.model.records import Consumer, FenceEvent, Members
from . import decode
from .calls import Call
from .decode_fence import WatchStart, decode_consumer, decode_fence, decode_fence_name, decode_start
from .decode_moment import decode_span
from .encode_fence import encode_consumer, encode_fence, encode_fence_event, encode_members, encode_sent
from .metrics import Metrics
from .outgoing import Counted, send_each
from .places import Places

Response = TypeVar("Response", bound=Message)

# The number of keys in a part of ReadInside.
KEYS_A_PART = 65_536


class FenceService:
    """The service.

    Args:
        fences: the fences.
        past_fences: what fences would have made of the past.
        pasts: limits the reads of the past at a time.
        metrics: counts the work.
        max_corners: the largest number of corners of an area.
        max_watch_lag: the seconds that a watcher may take to receive a response.
    """

    def __init__(
        self,
        fences: Fences,
        past_fences: PastFences,
        pasts: Places,
        metrics: Metrics,
        *,
        max_corners: int,
        max_watch_lag: float,
    ) -> None:
        self._fences = fences
        self._past_fences = past_fences
        self._pasts = pasts
        self._metrics = metrics
        self._max_corners = max_corners
        self._max_watch_lag = max_watch_lag

    async def CreateFence(self, request: pb.CreateFenceRequest, call: Call) -> pb.CreateFenceResponse:
        name = decode_fence_name(request.name)
        call.access.require_write(name)
        config = decode_fence(request, self._max_corners)
        _require_hulls(call, config)
        fence = await self._fences.create(name, config, gives_center=call.access.may_write(config.subjects))
        return pb.CreateFenceResponse(fence=encode_fence(fence, {}))

    async def ReplaceFence(self, request: pb.ReplaceFenceRequest, call: Call) -> pb.ReplaceFenceResponse:
        name = decode_fence_name(request.name)
        call.access.require_write(name)
        config = decode_fence(request, self._max_corners)
        _require_hulls(call, config)
        fence = await self._fences.replace(name, config)
        return pb.ReplaceFenceResponse(fence=encode_fence(fence, await oldest_events(fence)))

    async def DeleteFence(self, request: pb.DeleteFenceRequest, call: Call) -> pb.DeleteFenceResponse:
        name = decode_fence_name(request.name)
        call.access.require_write(name)
        _require_hulls(call, self._fences.get(name).fence.row.config)
        await self._fences.delete(name)
        return pb.DeleteFenceResponse()

    async def GetFence(self, request: pb.GetFenceRequest, call: Call) -> pb.GetFenceResponse:
        fence = self._read(call, request.name)
        return pb.GetFenceResponse(fence=encode_fence(fence, await oldest_events(fence)))

    async def ListFences(self, request: pb.ListFencesRequest, call: Call) -> pb.ListFencesResponse:
        prefix, after, size = decode.decode_page(request)
        fences, more = self._fences.page(call.access.readable(prefix), after, size)
        return pb.ListFencesResponse(
            fences=[encode_fence(fence, await oldest_events(fence)) for fence in fences],
            next_page_token=fences[-1].name if more else "",
        )

    async def ReadInside(self, request: pb.ReadInsideRequest, call: Call) -> None:
        fence = self._read(call, request.name)
        with call.cutoff():
            inside = await fence.inside()
        parts = [
            Members(each.hull, each.keys[first : first + KEYS_A_PART], each.revision)
            for each in inside.members
            for first in range(0, len(each.keys), KEYS_A_PART)
        ]
        for part in [[part] for part in parts] or [[]]:
            response = pb.ReadInsideResponse(sequence=inside.sequence, subjects=encode_members(part))
            await call.write_within(self._max_watch_lag, response)

    async def WatchFence(self, request: pb.WatchFenceRequest, call: Call) -> None:
        fence = self._read(call, request.name)
        start = decode_start(request)
        interval = decode.decode_rate(request.max_responses_per_second, "max_responses_per_second")
        progress = decode.decode_interval(request)
        after = await first_after(fence, request.uid, start, call)
        responses = watch_fence(
            fence, after, conflate=request.conflate, min_interval=interval, progress_interval=progress
        )
        encoded = sent_as(encode_sent, fence.uid)
        await send_each(call, responses, encoded, self._max_watch_lag, Counted(self._metrics, "fence"))

    async def AckFence(self, request: pb.AckFenceRequest, call: Call) -> pb.AckFenceResponse:
        return pb.AckFenceResponse(consumer=await acknowledged(self._read(call, request.name), request))

    async def DeleteConsumer(self, request: pb.DeleteConsumerRequest, call: Call) -> pb.DeleteConsumerResponse:
        fence = self._read(call, request.name)
        await fence.drop_consumer(decode_consumer(request.consumer))
        return pb.DeleteConsumerResponse()

    async def FenceEventsBetween(self, request: pb.FenceEventsBetweenRequest, call: Call) -> None:
        config = decode_fence(request, self._max_corners)
        call.access.require_past(config.subjects)
        if config.area_hull is not None:
            call.access.require_past(config.area_hull)
        start, end = decode_span(request)

        async def encoded(events: list[FenceEvent]) -> pb.FenceEventsBetweenResponse:
            return pb.FenceEventsBetweenResponse(events=map(encode_fence_event, events))

        with self._pasts.take(call.owner):
            found = self._past_fences.events(config, start, end)
            await send_each(call, found, encoded, self._max_watch_lag, Counted(self._metrics, "fence"))

    def _read(self, call: Call, name: str) -> LiveFence:
        name = decode_fence_name(name)
        call.access.require_read(name)
        return self._fences.get(name)


def _require_hulls(call: Call, config: FenceConfig) -> None:
    """Raise PermissionDeniedError if the hulls that a fence names may not be read."""
    call.access.require_read(config.subjects)
    if config.area_hull is not None:
        call.access.require_read(config.area_hull)


async def first_after(fence: LiveFence, uid: str, start: WatchStart, call: Call) -> int:
    """The sequence after which a watch of a fence or an alarm begins.

    Raises:
        FenceReplacedError: it is not that with the uid, which is empty for any.
        SequenceAheadError: it has not come so far.
    """
    if uid and uid != fence.uid:
        raise FenceReplacedError(fence.name, fence.uid)
    after = fence.fence.last if start.after is None else start.after
    if start.consumer is not None:
        with call.cutoff():
            consumer = await fence.acknowledge(start.consumer, None)
        after = consumer.acknowledged
    if after > fence.fence.last:
        raise SequenceAheadError("after_sequence", after, fence.fence.last)
    return after


def sent_as(encode: Callable[[Sent, str], Response], uid: str) -> Callable[[Sent], Awaitable[Response]]:
    """What makes messages of events that are sent; the first names the uid of the fence or alarm."""
    uids = chain([uid], repeat(""))

    async def encoded(sent: Sent) -> Response:
        message = encode(sent, next(uids))
        sent.events = []  # a client may take long to read the message, which is a tenth of their size
        return message

    return encoded


async def acknowledged(
    fence: LiveFence, request: pb.AckFenceRequest | alarm_service_pb2.AckAlarmRequest
) -> fence_pb2.FenceConsumer:
    """A consumer of a fence or an alarm, whose place has been stored."""
    name = decode_consumer(request.consumer)
    if request.sequence > decode.LARGEST_INTEGER:
        raise SequenceAheadError("sequence", request.sequence, fence.fence.last)
    consumer = await fence.acknowledge(name, request.sequence, request.uid)
    return encode_consumer(fence.fence, consumer, await oldest_of(fence, consumer))


async def oldest_events(fence: LiveFence) -> dict[str, int]:
    """The time of the oldest event in the backlog of each consumer that has one."""
    times = {name: await oldest_of(fence, consumer) for name, consumer in fence.fence.consumers.items()}
    return {name: time for name, time in times.items() if time is not None}


async def oldest_of(fence: LiveFence, consumer: Consumer) -> int | None:
    """The time of the oldest event in the backlog of a consumer, None if there is none."""
    events = await fence.events(consumer.acknowledged, 1)
    return events[0].time if events else None
