"""Calls about the quarantine of a keyed hull, made as those in `_calls`."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dynhull_proto.v1 import hull_service_pb2 as pb

from . import _messages as messages
from ._batch import Batch
from ._calls import Call, Pages, apply_batch
from ._quarantine_messages import HeldPosition, Quarantine, decode_held, encode_quarantine

MOST_A_PAGE = 1000

if TYPE_CHECKING:
    from ._messages import Applied, HullInfo


def set_quarantine(name: str, quarantine: Quarantine | None, *, timeout: float | None = None) -> Call[HullInfo]:
    """Replace the rules of the quarantine of a keyed hull, as one revision. HullUnsuitableError if it has no keys.

    Positions that are held stay so until a position or a batch lets them in or drops them.

    Args:
        name: the hull.
        quarantine: the rules; None for none.
        timeout: seconds, instead of the client's.
    """
    request = pb.SetQuarantineRequest(name=name, quarantine=encode_quarantine(quarantine or Quarantine()))
    return Call(
        "SetQuarantine", request, lambda response: messages.decode_info(response.hull), timeout, repeatable=False
    )


def release(
    name: str,
    keys: Any,
    *,
    drop: Any = None,
    producer: str = "",
    sequence: int = 0,
    may_skip: bool = False,
    timeout: float | None = None,
) -> Call[Applied]:
    """Let the held positions of keys in, whatever the rules say, as one batch. Keys that are not held are counted.

    Args:
        name: the hull.
        keys: n keys, as for `put`.
        drop: keys whose held position is dropped in the same batch.
        producer: as for `apply`.
        sequence: as for `apply`.
        may_skip: as for `apply`.
        timeout: seconds, instead of the client's.
    """
    return apply_batch(name, Batch(release=keys, drop=drop), producer, sequence, may_skip, timeout)


def drop(
    name: str,
    keys: Any,
    *,
    producer: str = "",
    sequence: int = 0,
    may_skip: bool = False,
    timeout: float | None = None,
) -> Call[Applied]:
    """Drop the held positions of keys, as one batch. Keys that are not held are counted.

    Args:
        name: the hull.
        keys: n keys, as for `put`.
        producer: as for `apply`.
        sequence: as for `apply`.
        may_skip: as for `apply`.
        timeout: seconds, instead of the client's.
    """
    return apply_batch(name, Batch(drop=keys), producer, sequence, may_skip, timeout)


def list_held(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Pages[HeldPosition]:
    """The positions in quarantine of a keyed hull, in the order of their keys, fetched page by page."""

    def decode(response: pb.ListHeldResponse) -> tuple[list[HeldPosition], str]:
        return decode_held(response), response.next_page_token

    def page(token: str) -> Call[tuple[list[HeldPosition], str]]:
        request = pb.ListHeldRequest(name=name, min_revision=min_revision, page_size=MOST_A_PAGE, page_token=token)
        return Call("ListHeld", request, decode, timeout)

    return page
