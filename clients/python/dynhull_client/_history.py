"""Calls about the past of a hull, made as those in `calls`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dynhull_proto.v1 import hull_service_pb2 as pb

from . import _messages as messages
from ._calls import Call
from ._history_messages import Erasure, History, decode_erasure, decode_history, encode_history
from ._keys import checked_keys, encode_keys

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


def erase_history(name: str, keys: Any, *, timeout: float | None = None) -> Call[Erasure | None]:
    """Erase keys from the past of a hull, which is then as if they had never been in it.

    All of it is erased at once, or none. What the hull has now stays: HullUnsuitableError if it has one of the keys,
    which `remove` takes out of it first. Backups that were made before, and events of fences, keep them. A hull without
    a history forgets all of its past. It takes as long as writing the past of the hull, so give it time.

    Args:
        name: the hull.
        keys: the keys.
        timeout: seconds, instead of the client's. After them the server goes on.

    Returns:
        What was erased; None if no batch that is filed had one of the keys.
    """
    request = pb.EraseHistoryRequest(name=name, keys=encode_keys(checked_keys(keys)))
    return Call("EraseHistory", request, decode_erasure, timeout)
