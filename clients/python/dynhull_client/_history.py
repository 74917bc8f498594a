"""Calls about the past of a hull, made as those in `calls`."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dynhull_proto.v1 import hull_service_pb2 as pb

from . import _messages as messages
from ._calls import Call
from ._history_messages import History, decode_history, encode_history

if TYPE_CHECKING:
    from datetime import timedelta

    from ._messages import HullInfo


def set_history(
    name: str,
    history: str | float | timedelta | bool | None,
    history_bytes: int | None = None,
    *,
    timeout: float | None = None,
) -> Call[HullInfo]:
    """Change how much of its past a hull keeps. What is to be kept no longer is gone within a minute.

    Args:
        name: the hull. HullUnsuitableError if it is divided among shards, or if its server can keep no past.
        history: for how long: True for ever, a timedelta, seconds, or text such as "30d"; None or False for not at all.
        history_bytes: in how many bytes at most, the oldest going first; None for any number.
        timeout: seconds, instead of the client's.
    """
    request = pb.SetHistoryRequest(name=name, history=encode_history(history, history_bytes))
    return Call("SetHistory", request, lambda response: messages.decode_info(response.hull), timeout)


def history(name: str, *, timeout: float | None = None) -> Call[History]:
    """What is there of the past of a hull.

    Args:
        name: the hull.
        timeout: seconds, instead of the client's.
    """
    return Call("GetHistory", pb.GetHistoryRequest(name=name), decode_history, timeout)
