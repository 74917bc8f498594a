"""Sending what comes bit by bit to a caller: the loop of all streams of answers."""

from collections.abc import AsyncGenerator, Awaitable, Callable
from contextlib import aclosing, nullcontext
from dataclasses import dataclass
from typing import Any, TypeVar

from google.protobuf.message import Message

from .calls import Call
from .metrics import Metrics

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Counted:
    """How the messages of a stream are counted.

    Attributes:
        metrics: counts them, and the caller as a watcher.
        kind: what a message is; a function of it where they differ.
    """

    metrics: Metrics
    kind: str | Callable[[Any], str]


async def send_each(
    call: Call,
    found: AsyncGenerator[T, None],
    encoded: Callable[[T], Awaitable[Message | bytes]],
    max_lag: float,
    counted: Counted | None = None,
) -> None:
    """Send what is found, until there is no more, or the call ends.

    Args:
        call: the call.
        found: what to send; closed at the end.
        encoded: makes a message of it. What it was made of is not held while the caller takes the message.
        max_lag: the seconds that the caller may take to receive a message.
        counted: how the messages are counted; None for not at all.
    """
    with nullcontext() if counted is None else counted.metrics.watcher() as watcher:
        async with aclosing(found):
            while True:
                with call.cutoff():
                    each = await anext(found, None)
                    if each is None:
                        return
                    call.require_entitled()
                    message = await encoded(each)
                    del each
                if counted is None:
                    await call.write_within(max_lag, message)
                    continue
                kind = counted.kind if isinstance(counted.kind, str) else counted.kind(message)
                with counted.metrics.sending(watcher, kind):
                    await call.write_within(max_lag, message)
