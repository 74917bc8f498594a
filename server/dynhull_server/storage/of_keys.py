"""What of a state, and of batches, is about some keys."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from dynhull.keys import key_list

from ..state.contents.deadlines import Key
from ..state.contents.key_rows import select_keys
from ..state.records import Contents, Expiry, KeyRows, Keys, Record, Times


def contents_of_keys(contents: Contents, keys: set[Key]) -> Contents:
    """The points of some keys, without what is held out of the hull."""
    if contents.keys is None:
        return contents
    chosen = _among(contents.keys, keys)
    return Contents(
        contents.points[chosen],
        select_keys(contents.keys, chosen),
        _rows(contents.times, chosen),
        _rows(contents.deadlines, chosen),
    )


def batches_of_keys(records: Iterable[Record], keys: set[Key]) -> Iterator[Record]:
    """Batches without the rows of other keys, those that have none left out; and all that let keys leave by time."""
    for record in records:
        if isinstance(record.rows, Expiry):
            yield record
            continue
        assert isinstance(record.rows, KeyRows)  # of a hull with keys
        rows = record.rows
        put, removed = _among(rows.keys, keys), _among(rows.removes, keys)
        if put.any() or removed.any():
            yield replace(
                record,
                rows=KeyRows(
                    select_keys(rows.keys, put),
                    rows.points[put],
                    select_keys(rows.removes, removed),
                    _rows(rows.times, put),
                    _rows(rows.deadlines, put),
                    rows.condition,
                ),
                center=None,
            )


def _among(keys: Keys, wanted: set[Key]) -> npt.NDArray[np.bool_]:
    return np.fromiter((key in wanted for key in key_list(keys)), np.bool_, len(keys))


def _rows(times: Times | None, which: npt.NDArray[np.bool_]) -> Times | None:
    return None if times is None else times[which]
