"""Requests about the consumers of a fence, and about the events that are kept for them."""

from ...errors import ConsumerNotFoundError, FenceReplacedError, LimitExceededError, SequenceAheadError
from ..model.records import Consumer
from ..model.requests import Acknowledge, DeleteConsumer, TrimEvents
from .leg import FenceLeg


def put_consumer(request: Acknowledge, leg: FenceLeg, most: int) -> Consumer:
    """Create a consumer if it is new, and acknowledge events; a fence has at most that many consumers."""
    fence = leg.fence
    if request.uid and request.uid != fence.row.uid:
        raise FenceReplacedError(fence.name, fence.row.uid)
    known = leg.consumers.get(request.consumer)
    if known is None and len(leg.consumers) >= most:
        raise LimitExceededError("max_fence_consumers", most)
    if request.sequence is not None and request.sequence > leg.last:
        raise SequenceAheadError("sequence", request.sequence, leg.last)
    acknowledged = leg.first - 1 if known is None else known.acknowledged
    lost = 0 if known is None else known.lost
    consumer = Consumer(request.consumer, max(acknowledged, request.sequence or 0), lost)
    if consumer != known:
        leg.acknowledge(consumer)
    return consumer


def drop_consumer(request: DeleteConsumer, leg: FenceLeg) -> None:
    """Delete a consumer."""
    if request.consumer not in leg.consumers:
        raise ConsumerNotFoundError(leg.fence.name, request.consumer)
    leg.consumers = {name: each for name, each in leg.consumers.items() if name != request.consumer}


def drop_events(request: TrimEvents, leg: FenceLeg) -> None:
    """Drop old events, and count them as lost by consumers that have not acknowledged them."""
    if leg.fence is not request.fence or request.first <= leg.first:
        return
    dropped = request.first - 1
    for name, consumer in leg.consumers.items():
        lost = dropped - max(consumer.acknowledged, leg.first - 1)
        if lost > 0:
            leg.acknowledge(Consumer(name, consumer.acknowledged, consumer.lost + lost))
    leg.first = request.first
