"""The rows of batches: consecutive revisions of a hull, which were committed together."""

import struct
from collections.abc import Iterator
from typing import Any

from ...state.records import CommitStamp, Record
from .encoding import checksum, decode
from .tables import COMMITS_SINCE


def commit_columns(version: int) -> str:
    """The columns with the number and the time of the commit; NULL in the formats that have none."""
    return "commit_number, committed" if version >= COMMITS_SINCE else "NULL, NULL"


def batch_checksum(payload: bytes, number: int, first: int, last: int, *commit: int | None) -> int:
    """The checksum of a row of hull `number`. One that was written by a format before 11 has no commit."""
    if commit == (None, None):
        return checksum(payload, number, first, last)
    return checksum(payload, number, first, last, *commit)  # type: ignore[arg-type]  # no other row has NULL


def is_whole(stored: Any, payload: Any, *values: Any) -> bool:
    """Whether a row has its checksum; `values` are what `batch_checksum` takes."""
    try:
        return bool(batch_checksum(payload, *values) == stored)
    except (TypeError, struct.error):
        return False


def batch_records(payload: bytes, first: int, number: int | None, time: int | None) -> Iterator[Record]:
    """The records of a row with this commit. ValueError if the payload has none."""
    commit = None if number is None or time is None else CommitStamp(number, time)
    for record in decode(payload, first):
        record.committed = commit
        yield record
