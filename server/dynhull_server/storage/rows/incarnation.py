"""A copy of a database is another incarnation of its hulls and fences: their uids are other ones.

Readers and writers that know what was after the copy was made can therefore tell that it is not there. The part of a
uid before INCARNATION stays, and what follows it is new with each copy: the same for all databases of a server, since a
hull over shards has its uid in several.
"""

from collections.abc import Iterator
from dataclasses import replace
from secrets import token_hex

from ...state.changes import Change
from ...state.fences.records import ChangeFence
from ...state.records import INCARNATION
from .ledger import ChangeHull, Ledger


def new_incarnation() -> str:
    """What distinguishes a copy from all others."""
    return token_hex(4)


def renewing(ledger: Ledger, incarnation: str) -> Iterator[Change | ChangeHull]:
    """The changes that make the hulls and fences of a database those of another incarnation. O(hulls and fences)."""
    for hull in ledger.hulls.values():
        yield ChangeHull(replace(hull.row, uid=_renewed(hull.row.uid, incarnation)))
    for fence in ledger.fences.values():
        yield ChangeFence(replace(fence.row, uid=_renewed(fence.row.uid, incarnation)))


def _renewed(uid: str, incarnation: str) -> str:
    return f"{uid.partition(INCARNATION)[0]}{INCARNATION}{incarnation}"
