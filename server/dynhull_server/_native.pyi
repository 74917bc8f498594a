"""
Events of fences, batches of the past and messages in C++, with the same results as in Python.
"""

from typing import Any


class Numbers:
    """A dictionary of integers, those of fences, without an object for each."""

    def __init__(self) -> None: ...

    def __len__(self) -> int: ...

    def __contains__(self, arg: int, /) -> bool: ...

    def __getitem__(self, key: int) -> int: ...

    def __setitem__(self, key: int, value: int) -> None: ...

    def pop(self, key: int) -> int: ...

def numbered(waiting: list[Any], names: tuple[str, ...], types: bytes, places: Numbers, table: object, last: int, time: int) -> tuple[bytes, bytes, bytes, bytes]:
    """
    The events of crossings: the bytes of their runs, of themselves, of their keys, and of what they say of their fences.
    """

def encoded(runs: object, rows: object, keys: bytes, own: object, names: tuple[str, ...], more: int) -> bytes:
    """
    Events as the bytes that are stored, without those of members and origins, whose flags are `more`.
    """

def followed(runs: object, places: Numbers, table: object, last: int, news: Numbers) -> bool:
    """
    Whether each run follows the last event of its fence; if so, `news` has the new last events.
    """

def own(runs: object, places: Numbers, table: object, subjects: int, names: tuple[int, ...]) -> bytes | None:
    """
    Of which runs the hull is the one that the fence names; None if a fence does not exist.
    """

def added(runs: object, places: Numbers, table: object, last: int, news: object, end: int, row: int) -> None:
    """
    Add runs to the columns of new ones, and set the last events of their fences.
    """

def counted(places: object, news: tuple[object, object, object, object], table: object, columns: tuple[int, int, int, int, int]) -> None:
    """
    Count events of fences at these places: two columns are set, two are added to, and the last is 1.
    """

def plain_batches(payloads: list[bytes], first: int, kind: int, wanted: list[bytes] | None) -> tuple[bytes, ...]:
    """
    The batches in payloads of the journal as columns, up to the first payload that has one of another kind; of keys, in UTF-8 or as eight bytes, only those that are wanted.
    """

def points_message(data: bytes) -> tuple[bytes, bool, int] | None:
    """
    The name in a StreamRequest, whether its points are inserts, and where they begin; None if it has anything else, or none.
    """

def puts_message(data: bytes) -> tuple[bytes, bool, list[tuple[int, bytes | None, bytes, bytes, bytes]]] | None:
    """
    The name in a StreamRequest whose batches put keys, whether it may have several, and of each its number, the keys as integers, or None and their lengths and text, and the points; None if it has anything else, or none.
    """

def acknowledged(sequence: int, fields: tuple[Any, ...]) -> bytes | None:
    """
    The StreamResponse with a result: its counts in the order of the fields, its clock, and the rows that are held. None if it has a clock or such rows.
    """

def results(outcomes: list[tuple[int, tuple[Any, ...]]]) -> bytes | None:
    """The same with several results and their numbers."""

class LastPlaces:
    """
    Of each key the last place that batches of the journal give it; there is room for `most` keys at once.
    """

    def __init__(self, kind: int, most: int = 0) -> None: ...

    def add(self, payloads: list[bytes], batches: list[int]) -> int:
        """
        Add payloads with so many batches each, up to the first that cannot be; the number of those that are.
        """

    def taken(self) -> tuple[int, int, bytes, bytes, bytes, bytes, bytes, bytes, bytes]:
        """
        The clock and the cause of the last batch; keys that are put, and removed, as lengths and text; and the points, times and deadlines of those that are put.
        """

def footer_groups(footer: bytes, column: int) -> tuple[int, int, list[tuple[int, bytes | None, bytes | None, int]]] | None:
    """
    Where the groups of rows of a Parquet file lie in its footer: the list, the first of them, and of each its end, the least and the greatest value of a column, and how many rows have none. None for what is no such footer.
    """

def keys_at(ends: object, text: bytes, codes: object) -> tuple[bytes, bytes]:
    """
    The lengths and the text of the keys with some numbers, of keys that lie one after the other; int32.
    """

def key_codes(lengths: bytes, data: bytes) -> bytes:
    """
    The number of each key, as int32: equal ones have the same, each that is new one more than those before.
    """
