"""SegmentColumns as Parquet, and back: bit for bit the same.

Positions are whole numbers with a scale, in the metadata of their column, where every one of them is a decimal number
of few places: these take a third of the bytes. Otherwise they are doubles. Rows lie by key, then revision, so that the
way of one key is one read, and so that numbers differ little from those before them.
"""

from __future__ import annotations

from base64 import b64encode
from bisect import bisect_left
from functools import cache, partial
from io import SEEK_END, BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dynhull.keys import PackedKeys, key_list

from ...compiled import native
from ...state.contents.key_rows import select_keys
from ...state.records import FOREVER, NO_TIME, Contents, Identity, Parts
from ...state.ways import KeyWays, Stamps
from ..port import DamagedError
from .by_key import RowsByKey
from .columns import CAUSES, KINDS, NONE, OPS, Codes, Integers, SegmentColumns, contents_of, joined
from .gathered import key_codes

if TYPE_CHECKING:
    import io
    from collections.abc import Callable, Iterator, Sequence

    import numpy.typing as npt
    import pyarrow as pa
    import pyarrow.parquet as pq

    from dynhull.keys import Keys

    from ...compiled import Native

    Rows = npt.NDArray[np.intp]

# The columns of numbers in which a row may have none, and what stands for it.
NOTHING = dict.fromkeys(("commit", "committed", "clock", "event_time"), NO_TIME) | {"expire_time": FOREVER}

# The least key of a group of rows and the greatest; what is less than any, and more than any, where that is not known.
Ends = tuple[tuple[Any, ...], tuple[Any, ...]]
UNKNOWN: Ends = ((0,), (1,))

VERSION = 1
MAGIC = b"PAR1"  # the last bytes of each file, after the number of those of the footer
ACCURACY = "accuracy"  # a column of files in which some position has an error, the last one
FORMAT, SCALE, STATE = b"dynhull.format", b"dynhull.scale", b"dynhull.state"
SCHEMA = b"ARROW:schema"  # where pyarrow has the types of columns, and what they say of themselves
MOST_PLACES = 12
EXACT = 2**53  # below that every whole number is a double
SAMPLE = 1000
LEVEL = 5  # 7 takes a quarter longer for a hundredth fewer bytes, at most
# Who asks for the way of a key decompresses one of these: of 2**17 rows they take 2.6 percent fewer bytes, but four
# times as long.
GROUP_ROWS = 2**14
# So many different times of commits in a file: each group says those that it has, so that larger ones take fewer bytes.
MANY_COMMITS, LARGE_GROUP_ROWS = 1024, 2**16
# The columns as other programs see them.
ORDER = (
    "revision",
    "commit",
    "committed",
    "cause",
    "kind",
    "op",
    "key",
    "x",
    "y",
    "event_time",
    "expire_time",
    "detail",
    "clock",
    "row",
)
CONSTANT: dict[str, tuple[str, ...]] = {"cause": CAUSES, "kind": KINDS, "op": OPS}  # mostly the same word in all rows
OF_REVISION = ("commit", "committed", "clock")  # the same in all rows of a revision
WORDS: tuple[str, ...] = ("cause", "kind", "op", "key")
CODED = ("key", "cause", "kind", "op", "detail")  # what is read as places in a list of words
# Numbers that differ from row to row take the fewest bytes with each of their bytes in a stream of its own.
SPLIT: tuple[str, ...] = ("revision", "commit", "row", "x", "y")
MOVES = ("put", "remove")
OF_CONTENTS = ("key", "x", "y", "event_time", "expire_time", ACCURACY)
TOGETHER = 4  # groups that are read at once where one after the other is needed
SHARED = 4  # rows of a commit, or of a key, on average, from which on its time, or it, is an index into those of all


def load() -> None:
    """Load what reads and writes files, if it is there: that takes a tenth of a second of the interpreter, or more."""
    try:
        import pyarrow as pa
        import pyarrow.compute
        import pyarrow.parquet
    except ImportError:
        return
    # Its own memory gives pages back between one segment and the next: to fetch them anew takes as long as the rest.
    pa.set_memory_pool(pa.system_memory_pool())
    pa.array([0])  # with its first value pyarrow loads pandas, if that is there: a second of who would wait for it


def to_parquet(columns: SegmentColumns, about: dict[str, str], state: bytes = b"") -> bytes:
    """SegmentColumns as a file.

    Args:
        columns: the rows.
        about: what the file says of itself.
        state: of a state, what is not in its rows.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    commits = np.count_nonzero(np.diff(columns.committed)) + 1
    shared = commits * SHARED <= len(columns)
    group_rows = LARGE_GROUP_ROWS if shared and commits >= MANY_COMMITS else GROUP_ROWS
    order, key, keys = _sorted(columns, group_rows)
    words = WORDS if keys * SHARED <= len(columns) else CONSTANT
    found = _in_order(columns, order, key)
    fields = {name: pa.field(name, _seen_as(column.type)) for name, column in found.items()}
    there = ~np.isnan(columns.points[:, 0])
    for place, name in enumerate("xy"):
        found[name], scale = _scaled(columns.points[:, place], there, order)
        metadata = None if scale is None else {SCALE: str(scale).encode()}
        fields[name] = pa.field(name, found[name].type, metadata=metadata)
    names = [*ORDER, ACCURACY] if ACCURACY in found else list(ORDER)
    told = {f"dynhull.{name}".encode(): value.encode() for name, value in about.items()}
    head = {FORMAT: str(VERSION).encode(), b"dynhull.identity": columns.identity.encode()} | told
    schema = pa.schema([fields[name] for name in names], {**head, STATE: state} if state else head)
    table = pa.table([found[name] for name in names], names)
    sink = pa.BufferOutputStream()
    with pq.ParquetWriter(
        sink,
        table.schema,
        store_schema=False,
        compression="zstd",
        compression_level=LEVEL,
        use_dictionary=[*words, "committed"] if shared else list(words),
        column_encoding=dict.fromkeys(SPLIT if shared else (*SPLIT, "committed"), "BYTE_STREAM_SPLIT"),
        write_page_checksum=True,
    ) as writer:
        writer.write_table(table, row_group_size=group_rows)
        # Others are to see words, and not that they were written as places in a list of them.
        writer.add_key_value_metadata({**schema.metadata, SCHEMA: b64encode(schema.serialize().to_pybytes())})
    return bytes(sink.getvalue().to_pybytes())


def _in_order(columns: SegmentColumns, order: Rows, key: pa.ChunkedArray | pa.Array) -> dict[str, pa.Array]:
    """All columns but positions, in the order of a file. What is the same in all rows needs no order."""
    import pyarrow as pa

    time = pa.timestamp("us", "UTC")
    found = {
        "revision": pa.array(columns.revision[order]),
        "commit": _optional(columns.commit, NO_TIME, pa.int64(), order),
        "committed": _optional(columns.committed, NO_TIME, time, order),
        "cause": _words(columns.cause, CAUSES, order),
        "kind": _words(columns.kind, KINDS, order),
        "op": _words(columns.op, OPS, order),
        "key": key,
        "event_time": _optional(columns.event_time, NO_TIME, time, order),
        "expire_time": _optional(columns.expire_time, FOREVER, time, order),
        "detail": _optional_words(columns.detail, order),
        "clock": _optional(columns.clock, NO_TIME, time, order),
        "row": pa.array(columns.place[order].astype(np.int32)),
    }
    if columns.accuracy.any():
        accuracy = columns.accuracy[order]
        found[ACCURACY] = pa.array(accuracy, mask=accuracy == 0)
    return found


def _seen_as(kind: pa.DataType) -> pa.DataType:
    import pyarrow as pa

    return kind.value_type if pa.types.is_dictionary(kind) else kind


def from_parquet(data: bytes, name: str) -> tuple[SegmentColumns, dict[str, str], bytes]:
    """The inverse of `to_parquet`.

    Raises:
        DamagedError: it is no file of ours, or of a newer version.
    """
    rows, about, state = rows_from_parquet(data, name)
    return rows.columns(0, len(rows.starts) - 1), about, state


def rows_from_parquet(data: bytes, name: str) -> tuple[RowsByKey, dict[str, str], bytes]:
    """The same with the rows as they lie in the file.

    Raises:
        DamagedError: it is no file of ours, or of a newer version.
    """
    import pyarrow as pa

    try:
        file = _whole(data, name)
        found = file.metadata.metadata
        return _by_key(file), _about(found), found.get(STATE, b"")
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{name} is damaged: {error}") from error


def state_from_parquet(data: bytes, name: str) -> tuple[Parts, bytes]:
    """The contents of a state, those of keys a group of rows at a time, and what is not in its rows.

    Raises:
        DamagedError: it is no file of ours, or of a newer version; also when a part is read.
    """
    import pyarrow as pa

    try:
        file = _whole(data, name)
        found = file.metadata.metadata
        same = _same([file.metadata.row_group(group) for group in range(file.num_row_groups)])
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{name} is damaged: {error}") from error
    if (same.get("kind"), same.get("op")) == ("rows", "put"):
        return Parts(file.metadata.num_rows, _contents(file, name, same)), found.get(STATE, b"")
    columns, about, told = from_parquet(data, name)
    contents = contents_of(columns, about)
    return Parts(len(contents), [contents]), told


def _contents(file: pq.ParquetFile, name: str, same: dict[str, str | None]) -> Iterator[Contents]:
    """The contents of a state that has nothing but keys with points, as its statistics say."""
    import pyarrow as pa

    about = _about(file.metadata.metadata)
    identity: Any = about["identity"]
    names = [each for each in file.schema_arrow.names if each in OF_CONTENTS and each not in same]
    try:
        for group in range(file.num_row_groups):
            table = file.read_row_group(group, columns=names, use_threads=False)
            codes, words = _coded(table.column("key"))
            found = {each: _constant(none, len(table)) for each, none in NOTHING.items()} | _arrays(table)
            yield Contents(
                found["points"],
                _packed(words, codes, identity),
                np.ascontiguousarray(found["event_time"]) if about["times"] == "True" else None,
                np.ascontiguousarray(found["expire_time"]) if about["deadlines"] == "True" else None,
                accuracies=found.get(ACCURACY),
            )
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{name} is damaged: {error}") from error


def _whole(data: bytes, name: str) -> pq.ParquetFile:
    """A file all of whose rows are read."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    file = _opened(pa.BufferReader(data), name)
    if _has_places(file):
        return file
    return pq.ParquetFile(pa.BufferReader(data), metadata=file.metadata, read_dictionary=CODED[1:])


class RowsOfKeys(NamedTuple):
    """The rows of a file that have some keys, or none.

    Attributes:
        name: the file.
        table: those columns that are not the same in all of these rows; the keys are one after the other.
        same: what the others have in all rows.
        about: what the file says of itself.
        state: of a state, what is not in its rows.
    """

    name: str
    table: pa.Table
    same: dict[str, str | None]
    about: dict[str, str]
    state: bytes

    def like(self, other: RowsOfKeys) -> bool:
        """Whether both have the same columns, and positions with the same scale."""
        return self.same == other.same and self.table.schema.equals(other.table.schema, check_metadata=True)


def keys_from_parquet(source: io.IOBase, name: str, keys: Keys) -> RowsOfKeys:
    """The rows of some keys, and of none, alone: no more is read than the groups that have these.

    Raises:
        DamagedError: it is no file of ours, or of a newer version.
        StorageError: those of the source.
    """
    import pyarrow as pa

    try:
        values = sorted(key_list(keys))
        value = bytes.decode if isinstance(keys, PackedKeys) else _integer
        file, groups = _of_keys(source, name, values, value)
        metadata, found = file.metadata, file.metadata.metadata
        same = _same([metadata.row_group(group) for group in groups]) if groups else {}
        names = (*ORDER, ACCURACY)[: metadata.num_columns]
        table = file.read_row_groups(groups, columns=_unknown(names, same), use_threads=False)
        rows = _rows_of(table.replace_schema_metadata(), values)
        return RowsOfKeys(name, rows, same, _about(found), found.get(STATE, b""))
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{name} is damaged: {error}") from error


def columns_of_keys(parts: Sequence[RowsOfKeys]) -> SegmentColumns:
    """The rows of some keys of one file or more of a hull, by revision and place.

    As each step takes about as long for a hundred rows as for thousands, files that are alike are one table.

    Raises:
        DamagedError: it is no file of ours.
    """
    import pyarrow as pa

    identity: Any = parts[0].about["identity"]
    found, begin = [], 0
    for end in range(1, len(parts) + 1):
        if end < len(parts) and parts[end].like(parts[begin]):
            continue
        try:
            table = _ordered(pa.concat_tables([each.table for each in parts[begin:end]]))
            found.append(_columns(table, parts[begin].same, identity))
        except (pa.ArrowException, KeyError, ValueError, TypeError) as error:
            names = parts[begin].name if end - begin == 1 else f"{parts[begin].name}, or one of {end - begin - 1} more,"
            raise DamagedError(f"{names} is damaged: {error}") from error
        begin = end
    return joined(found, identity)


def ways_from_parquet(data: bytes, name: str, after: int, until: int) -> Iterator[KeyWays] | None:
    """What the batches after a revision up to another one do to all keys, a group of rows at a time.

    None if the batches of the file do more than to put and remove keys, or have no times.

    Raises:
        DamagedError: it is no file of ours, or of a newer version; also when a group is read.
    """
    import pyarrow as pa

    try:
        file = _opened(pa.BufferReader(data), name)
        groups = [file.metadata.row_group(group) for group in range(file.num_row_groups)]
        place = {file.metadata.schema.column(column).path: column for column in range(file.metadata.num_columns)}
        if not all(_is_plain(group, place) for group in groups):
            return None
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{name} is damaged: {error}") from error
    return _ways(file, name, after, until)


def _is_plain(group: pq.RowGroupMetaData, place: dict[str, int]) -> bool:
    """Whether rows do nothing but put and remove keys, as their statistics say."""

    def of(name: str) -> Any:
        found = group.column(place[name]).statistics
        return found if found is not None and found.has_null_count else None

    found = {name: of(name) for name in ("event_time", "expire_time", "clock", "detail", "committed", "kind", "op")}
    if any(each is None for each in found.values()):
        return False
    kind, op = found["kind"], found["op"]
    return (
        all(found[name].null_count == group.num_rows for name in ("event_time", "expire_time", "clock", "detail"))
        and found["committed"].null_count == 0
        and (kind.min, kind.max, kind.null_count) == ("rows", "rows", 0)
        and (op.null_count == group.num_rows or (op.min in MOVES and op.max in MOVES))
    )


def _ways(file: pq.ParquetFile, name: str, after: int, until: int) -> Iterator[KeyWays]:
    import pyarrow as pa

    identity: Any = file.schema_arrow.metadata[b"dynhull.identity"].decode()
    of_revision = file.schema_arrow.names.index("revision")
    try:
        for first in range(0, file.num_row_groups, TOGETHER):
            groups = range(first, min(first + TOGETHER, file.num_row_groups))
            table = file.read_row_groups(groups, columns=["key", "x", "y"])
            codes, words = _coded(table.column("key"))
            x, y = (_coordinates(table, each) for each in "xy")
            found = [file.metadata.row_group(group).column(of_revision).statistics for group in groups]
            within: slice | Rows = slice(None)
            if not all(after < each.min and each.max <= until for each in found):
                revisions = _stamps(file, groups, within).revisions
                within = np.flatnonzero((after < revisions) & (revisions <= until))
            rows = within
            if codes.min(initial=0) == NONE or isinstance(within, np.ndarray):
                rows = np.arange(len(table))[within]
                rows = rows[codes[rows] != NONE]
                codes, x, y = codes[rows], x[rows], y[rows]
            starts = _starts(codes, words)
            keys = _packed(words, codes[starts], identity)
            yield KeyWays(keys, starts, x, y, *(partial(_stamps, file, groups, each) for each in (rows, within)))
    except (pa.ArrowException, OSError, KeyError, ValueError, TypeError) as error:
        raise DamagedError(f"{name} is damaged: {error}") from error


def _starts(codes: npt.NDArray[np.int32], words: pa.Array) -> Rows:
    """Where another key begins: of integers there is a word for each row, equal or not."""
    import pyarrow as pa

    values = words.take(pa.array(codes)).to_numpy() if pa.types.is_uint64(words.type) else codes
    return np.flatnonzero(np.append(True, values[1:] != values[:-1])[: len(values)])


def _begins(keys: pa.Array) -> npt.NDArray[np.bool_]:
    """Which of some keys in order differ from the one before."""
    import pyarrow.compute as pc

    differ = pc.not_equal(keys.slice(1), keys.slice(0, max(len(keys) - 1, 0))).to_numpy(zero_copy_only=False)
    return np.append(True, differ)[: len(keys)].astype(np.bool_)


def _stamps(file: pq.ParquetFile, groups: Sequence[int], rows: slice | Rows) -> Stamps:
    """The revisions of some rows of groups, and their commits."""
    table = file.read_row_groups(groups, columns=["revision", "commit", "committed"])
    return Stamps(*(_integers(table, each, NO_TIME)[rows] for each in ("revision", "commit", "committed")))


def _opened(source: pa.NativeFile | io.IOBase, name: str, metadata: pq.FileMetaData | None = None) -> pq.ParquetFile:
    """A file whose words are read as places in a list of them. DamagedError if it is none of ours, or too new."""
    import pyarrow.parquet as pq

    file = pq.ParquetFile(source, metadata=metadata, read_dictionary=CODED, pre_buffer=False)  # all bytes are near
    found = file.metadata.metadata or {}
    if FORMAT not in found:
        raise DamagedError(f"{name} is a Parquet file of another program")
    if int(found[FORMAT]) > VERSION:
        raise DamagedError(f"{name} has format {int(found[FORMAT])}, this version reads {VERSION}")
    return file


def _has_places(file: pq.ParquetFile) -> bool:
    """Whether the keys of rows are read as places in a list of them: not where most rows have another one."""
    if STATE in file.metadata.metadata or not file.num_row_groups:  # earlier versions wrote all as such
        return False
    return "RLE_DICTIONARY" in file.metadata.row_group(0).column(ORDER.index("key")).encodings


def _integer(stored: bytes) -> int:
    return int.from_bytes(stored, "little")


def _of_keys(
    source: io.IOBase, name: str, values: list[Any], value: Callable[[bytes], Any]
) -> tuple[pq.ParquetFile, Sequence[int]]:
    """A file, and those of its groups of rows that may have one with these keys, or with none.

    `value` returns a key of which a footer has the bytes.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    footer = None if native is None else _chosen(native, source, values, value)
    if footer is not None:
        file = _opened(source, name, pq.read_metadata(pa.BufferReader(footer)))
        return file, range(file.num_row_groups)
    file = _opened(source, name)
    column = ORDER.index("key")

    @cache
    def ends(place: int) -> Ends:
        found = file.metadata.row_group(place).column(column).statistics
        if found is None or not found.has_min_max:
            return UNKNOWN
        return (0, found.min), (1,) if found.null_count else (0, found.max)

    return file, _groups(ends, file.num_row_groups, values)


def _chosen(native: Native, source: io.IOBase, values: list[Any], value: Callable[[bytes], Any]) -> bytes | None:
    """The footer of a file as if it had no other groups than those of some keys; None for pyarrow to read all of it."""
    place = source.seek(-len(MAGIC) - 4, SEEK_END)
    end = source.read(4 + len(MAGIC))
    size = int.from_bytes(end[:4], "little")
    if size > place or end[4:] != MAGIC:
        return None
    source.seek(place - size)
    footer = source.read(size)
    found = native.footer_groups(footer, ORDER.index("key"))
    if found is None:
        return None
    begin, first, of_groups = found

    def ends(place: int) -> Ends:
        _, least, greatest, none = of_groups[place]
        if least is None or greatest is None:
            return UNKNOWN
        return (0, value(least)), (1,) if none else (0, value(greatest))

    starts = [first, *(each[0] for each in of_groups)]
    some = [footer[starts[group] : starts[group + 1]] for group in _groups(ends, len(of_groups), values)]
    shorter = b"".join([footer[:begin], _list_of_structs(len(some)), *some, footer[starts[-1] :]])
    return b"".join([shorter, len(shorter).to_bytes(4, "little"), MAGIC])


def _list_of_structs(size: int) -> bytes:
    """What such a list begins with in Thrift's compact protocol."""
    struct, many = 12, 15
    if size < many:
        return bytes([size << 4 | struct])
    found = bytearray([many << 4 | struct])
    while size >= 128:
        found.append(size & 127 | 128)
        size >>= 7
    return bytes([*found, size])


def _groups(ends: Callable[[int], Ends], count: int, values: list[Any]) -> list[int]:
    """The groups of rows, which lie by key, that may have one with these keys, or with none: these are the last."""
    places = range(count)
    found = set[int]()
    for place in reversed(places):
        if ends(place)[1] != (1,):
            break
        found.add(place)
    for value in values:
        place = bisect_left(places, (0, value), key=lambda place: ends(place)[1])
        while place < len(places) and ends(place)[0] <= (0, value):
            found.add(place)
            place += 1
    return sorted(found)


def _unknown(names: Sequence[str], same: dict[str, str | None]) -> list[str]:
    """The columns to read for the rows of keys: not those that are the same in all rows, nor the numbers of commits.

    Where every row puts a key, or every row removes one, no revision has two of a key, and which comes first is known.
    """
    known = {"commit", *same, *(("row",) if "kind" in same and "op" in same else ())}
    return [name for name in names if name == "key" or name not in known]


def _same(groups: Sequence[pq.RowGroupMetaData]) -> dict[str, str | None]:
    """The columns that have the same word in each row of groups, as their statistics say; None for no value at all."""
    count = sum(group.num_rows for group in groups)
    same: dict[str, str | None] = {}
    for place, name in enumerate(ORDER):
        found = [group.column(place).statistics for group in groups]
        if any(each is None or not each.has_null_count for each in found):
            continue
        nulls = sum(each.null_count for each in found)
        if nulls == count:
            same[name] = None
        elif name in CONSTANT and not nulls and all(each.has_min_max for each in found):
            words = {word for each in found for word in (each.min, each.max)}
            if len(words) == 1:
                same[name] = words.pop()
    return same


def _about(found: dict[bytes, bytes]) -> dict[str, str]:
    return {
        key.decode().removeprefix("dynhull."): value.decode()
        for key, value in found.items()
        if key.startswith(b"dynhull.") and key != STATE
    }


def _by_key(file: pq.ParquetFile) -> RowsByKey:
    """All rows, a group at a time: of all of them there are no arrays but those that are the result.

    Memory that is new takes longer than what is done with it.
    """
    identity: Any = file.metadata.metadata[b"dynhull.identity"].decode()
    count, distinct = file.metadata.num_rows, STATE in file.metadata.metadata
    same = _same([file.metadata.row_group(group) for group in range(file.num_row_groups)]) if count else {}
    placed = _placed(file)
    revisions = len(placed.starts) - 1
    of_rows: dict[str, npt.NDArray[Any]] = {
        name: np.broadcast_to(_code(same[name], name, words), count) for name, words in CONSTANT.items() if name in same
    }
    apart = OF_REVISION if revisions * SHARED <= count else ()
    known = {*of_rows, *same, *apart, "revision", "row"}
    columns = [name for name in file.schema_arrow.names if name not in known]
    detail: dict[int, str] = {}
    codes, words, at = np.full(count, NONE, np.int32), _Words(identity, _size(file, "key"), distinct=distinct), 0
    for group in range(file.num_row_groups):
        table = file.read_row_group(group, columns=columns, use_threads=False)
        rows = slice(at, at + len(table))
        _add_arrays(of_rows, table, rows, count)
        if "key" in columns:
            codes[rows] = words.numbers(table.column("key"))
        if "detail" in columns:
            found = enumerate(table.column("detail").to_pylist(), at)
            detail |= {row: text for row, text in found if text is not None}
        at += len(table)
    for name in CONSTANT:
        of_rows.setdefault(name, np.full(count, NONE, np.int8))  # of no rows: the state of an empty hull
    for name, none in NOTHING.items():
        if name not in apart:
            of_rows.setdefault(name, _constant(none, count))
    of_rows.setdefault(ACCURACY, _exact(count))
    if "points" not in of_rows:
        of_rows["points"] = np.full((count, 2), np.nan)
    of_revisions = _of_revisions(file, [name for name in apart if name not in same], placed)
    of_revisions |= {name: _constant(NO_TIME, revisions) for name in apart if name in same}
    return RowsByKey(identity, *placed, of_revisions, of_rows, codes, words.keys, detail)


def _size(file: pq.ParquetFile, name: str) -> int:
    """The bytes of a column, not compressed: not fewer than the words in it have, each once in a group."""
    place = file.schema_arrow.names.index(name)
    groups = range(file.num_row_groups)
    return sum(int(file.metadata.row_group(group).column(place).total_uncompressed_size) for group in groups)


def _add_arrays(of_rows: dict[str, npt.NDArray[Any]], table: pa.Table, rows: slice, count: int) -> None:
    """Write the columns of words, positions and numbers of a group to where its rows are among all."""
    for name, values in _arrays(table).items():
        none = NOTHING.get(name, np.nan if name == "points" else 0.0 if name == ACCURACY else NONE)
        if name not in of_rows:
            if values.strides == (0,):  # there has been none so far
                continue
            of_rows[name] = np.empty((count, *values.shape[1:]), values.dtype)
            of_rows[name][: rows.start] = none
        of_rows[name][rows] = values


class _Words:
    """The keys of groups of rows, which lie by key, and a number for each of them.

    Their bytes lie one after the other, in a block with room for `most` bytes: to grow would take new memory.
    """

    def __init__(self, identity: Identity, most: int, *, distinct: bool) -> None:
        self._identity = identity
        self._distinct = distinct  # as in a state, where every row has another one
        self._lengths, self._text = BytesIO(), BytesIO(bytes(most))  # integers have no lengths
        self._count = 0
        self._last: str | int | None = None
        self._ends: npt.NDArray[np.int32] | None = None  # where each begins, and the end of the last one

    def numbers(self, column: pa.ChunkedArray) -> npt.NDArray[np.int32]:
        """The numbers of the keys of the next group, NONE for no key. The first may be the last one before it."""
        import pyarrow as pa

        codes, words = _coded(column)
        if not pa.types.is_dictionary(column.type):
            words = words.drop_null()
        if not (self._distinct or pa.types.is_dictionary(column.type)):
            begins = _begins(words)
            codes[codes != NONE] = np.cumsum(begins, dtype=np.int32) - 1
            words = words.filter(pa.array(begins))
        first = self._count
        if first and len(words) and words[0].as_py() == self._last:
            first -= 1
            words = words[1:]
        if len(words):
            self._add(words)
        if first:
            codes = np.where(codes == NONE, np.int32(NONE), codes + np.int32(first))
        return codes

    def _add(self, words: pa.Array) -> None:
        import pyarrow as pa

        self._last = words[-1].as_py()
        self._count += len(words)
        if self._identity == "int":
            self._text.write(words.cast(pa.uint64()).to_numpy(zero_copy_only=False))
            return
        lengths, text = _text(words.cast(pa.string()))
        self._lengths.write(lengths.tobytes())
        self._text.write(text)

    def keys(self, codes: npt.NDArray[np.int32]) -> Keys:
        """The keys with some numbers; all strings in order are those that are there, and not copied."""
        import pyarrow as pa

        ascending = bool((codes[1:] > codes[:-1]).all())
        self._text.truncate()
        if self._identity == "str" and len(codes) == self._count and ascending:
            return PackedKeys(self._lengths.getvalue(), self._text.getvalue())
        text = self._text.getvalue()
        if self._identity == "int":
            integers: npt.NDArray[np.uint64] = np.frombuffer(text, np.uint64)[codes]
            return integers
        if self._ends is None:
            self._ends = np.zeros(self._count + 1, np.int32)
            np.cumsum(np.frombuffer(self._lengths.getvalue(), np.uint8), out=self._ends[1:])
        if native is not None:
            return PackedKeys(*native.keys_at(self._ends, text, np.ascontiguousarray(codes)))
        words = pa.StringArray.from_buffers(self._count, pa.py_buffer(self._ends), pa.py_buffer(text))
        return _packed(words, codes, self._identity)


def _of_revisions(file: pq.ParquetFile, names: list[str], placed: _Placed) -> dict[str, Integers]:
    """What all rows of a revision have in common: no more is read than each of them once."""
    if not names:
        return {}
    counts = np.diff(placed.starts)
    since = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    found = {name: np.full(len(counts), NO_TIME, np.int64) for name in names}
    seen, group, at = np.zeros(len(counts), np.bool_), 0, 0
    while group < file.num_row_groups and not seen.all():
        table = file.read_row_group(group, columns=list(found), use_threads=False)
        which = since[placed.places[at : at + len(table)]]
        for name, values in found.items():
            values[which] = _integers(table, name, NO_TIME)
        seen[which] = True
        group, at = group + 1, at + len(table)
    return found


class _Placed(NamedTuple):
    """Where rows belong, which say that themselves: what RowsByKey has of it."""

    first: int
    starts: npt.NDArray[np.int32]
    places: npt.NDArray[np.int32]
    rows: npt.NDArray[np.int32]


def _placed(file: pq.ParquetFile) -> _Placed:
    """Where the rows of a file belong. ValueError if one is missing."""
    count = file.metadata.num_rows
    if not count:
        return _Placed(0, np.zeros(1, np.int32), np.empty(0, np.int32), np.empty(0, np.int32))
    first, last = _bounds(file, "revision")
    if last - first >= count or _bounds(file, "row")[0] < 0:
        raise ValueError("a row is missing")
    numbers = _numbers(file, "row")
    since = _numbers(file, "revision", first)
    if first == last:
        starts, places = np.array([0, count], np.int32), numbers
    else:
        revisions = last - first + 1
        if revisions == count:  # as many as rows: if some has two, a place stays empty
            starts, places = np.arange(count + 1, dtype=np.int32), since
        else:
            counts = np.bincount(since, minlength=revisions)
            if not counts.all():
                raise ValueError("a row is missing")
            starts = np.zeros(revisions + 1, np.int32)
            np.cumsum(counts, out=starts[1:])
            places = starts[since]
        if numbers.strides != (0,):
            places = places + numbers
    if places.max() >= count:
        raise ValueError("a row is missing")
    rows = np.full(count, NONE, np.int32)
    for at in range(0, count, GROUP_ROWS):  # a part at a time: numpy makes other numbers of those that it is given
        some = places[at : at + GROUP_ROWS]
        rows[some] = np.arange(at, at + len(some), dtype=np.int32)
    if rows.min() == NONE:
        raise ValueError("a row is missing")
    return _Placed(first, starts, places, rows)


def _numbers(file: pq.ParquetFile, name: str, first: int = 0) -> npt.NDArray[np.int32]:
    """A column of all rows, less a number. It is not read where its bounds say that all are the same."""
    least, greatest = _bounds(file, name)
    count, at = file.metadata.num_rows, 0
    if greatest - first >= count:
        raise ValueError("a row is missing")
    if least == greatest:
        return np.broadcast_to(np.int32(least - first), count)
    found = np.empty(count, np.int32)
    for group in range(file.num_row_groups):
        table = file.read_row_group(group, columns=[name], use_threads=False)
        np.subtract(_integers(table, name, NO_TIME), first, out=found[at : at + len(table)], casting="same_kind")
        at += len(table)
    if int(found.min()) != least - first or int(found.max()) != greatest - first:
        raise ValueError(f"column {name} has other numbers than its bounds say")
    return found


def _bounds(file: pq.ParquetFile, name: str) -> tuple[int, int]:
    """The least number of a column, and the greatest one, as the statistics of its groups say."""
    place = ORDER.index(name)
    found = [file.metadata.row_group(group).column(place).statistics for group in range(file.num_row_groups)]
    if not all(each is not None and each.has_min_max and not each.null_count for each in found):
        raise ValueError(f"column {name} does not say what it has")
    return min(each.min for each in found), max(each.max for each in found)


def _rows_of(table: pa.Table, values: list[Any]) -> pa.Table:
    """The rows of some keys, which lie by key, and of none, which are the last."""
    import pyarrow as pa

    ranges, at = [np.empty((0, 2), np.intp)], 0
    for chunk in table.column("key").chunks:
        there = len(chunk) - chunk.null_count
        ranges.append(at + _ranges(chunk.slice(0, there), values))
        if chunk.null_count:
            ranges.append(np.array([[at + there, at + len(chunk)]]))
        at += len(chunk)
    some = np.concatenate(ranges)
    if len(some) == 1:
        return table.slice(some[0, 0], some[0, 1] - some[0, 0])
    return table.take(pa.array(np.concatenate([np.arange(first, last) for first, last in [*some.tolist(), (0, 0)]])))


def _ranges(column: pa.Array, values: list[Any]) -> npt.NDArray[np.intp]:
    """Where the rows of each of some keys begin and end, in rows that all have one and lie by key."""
    import pyarrow as pa
    import pyarrow.compute as pc

    wanted = pa.array(values, pa.uint64() if pa.types.is_uint64(column.type) else pa.string())
    places, rows = wanted, column
    if pa.types.is_dictionary(column.type):
        places, rows = pc.index_in(wanted, value_set=column.dictionary).drop_null(), column.indices
    ends = [np.searchsorted(rows.to_numpy(), places.to_numpy(), side) for side in ("left", "right")]
    found = np.column_stack(ends)
    return found[found[:, 0] < found[:, 1]]


def _ordered(table: pa.Table) -> pa.Table:
    """Rows by revision and place."""
    import pyarrow as pa

    revision = _integers(table, "revision", NO_TIME)
    place = _integers(table, "row", NO_TIME) if "row" in table.schema.names else np.zeros_like(revision)
    order = np.lexsort((place, revision))
    return table if bool((np.diff(order) == 1).all()) else table.take(pa.array(order))


def _columns(table: pa.Table, same: dict[str, str | None], identity: Identity) -> SegmentColumns:
    """Some rows, of which some columns are the same everywhere."""
    count = len(table)
    codes, words = _coded(table.column("key"))
    keyed = codes != NONE
    keys = _packed(words, codes[keyed], identity)
    arrays = {name: _constant(none, count) for name, none in NOTHING.items()} | _arrays(table)
    for name, words_of in CONSTANT.items():
        if name in same:
            arrays[name] = np.broadcast_to(_code(same[name], name, words_of), count)
    arrays.setdefault(ACCURACY, _exact(count))
    arrays["revision"] = _integers(table, "revision", NO_TIME)
    arrays["place"] = _integers(table, "row", NO_TIME) if "row" in table.schema.names else _constant(0, count)
    arrays.setdefault("points", np.full((count, 2), np.nan))
    detail = table.column("detail").to_pylist() if "detail" in table.schema.names else [None] * count
    return SegmentColumns(identity=identity, **arrays, keyed=keyed, keys=keys, detail=detail)


def _arrays(table: pa.Table) -> dict[str, npt.NDArray[Any]]:
    """The columns of words, positions and numbers that are there."""
    there = table.schema.names
    found: dict[str, npt.NDArray[Any]] = {
        name: _codes(table, name, words) for name, words in CONSTANT.items() if name in there
    }
    found |= {name: _integers(table, name, none) for name, none in NOTHING.items() if name in there}
    if "x" in there:
        found["points"] = np.column_stack([_coordinates(table, name) for name in "xy"])
    if ACCURACY in there:
        found[ACCURACY] = _filled(table.column(ACCURACY), 0.0).to_numpy()
    return found


def _exact(count: int) -> npt.NDArray[np.float64]:
    """No errors."""
    return np.broadcast_to(np.float64(0), count)


def _optional(values: Integers, none: int, kind: pa.DataType, order: Rows) -> pa.Array:
    """Numbers, of which some are none: as a rule all of them, or no one."""
    import pyarrow as pa

    there = np.count_nonzero(values != none)
    if not there:
        return pa.nulls(len(values), kind)
    some = values[order]
    return pa.array(some, kind, mask=None if there == len(values) else some == none)


def _optional_words(words: list[str | None], order: Rows) -> pa.Array:
    import pyarrow as pa

    if words.count(None) == len(words):
        return pa.nulls(len(words), pa.string())
    return pa.array([words[place] for place in order.tolist()], pa.string())


def _words(codes: Codes, words: tuple[str, ...], order: Rows) -> pa.DictionaryArray:
    """Words as places in a list of those that there are."""
    import pyarrow as pa

    used = np.flatnonzero(np.bincount(codes + 1, minlength=len(words) + 1)[1:])
    places = np.full(len(words) + 1, NONE, np.int8)
    places[used] = np.arange(len(used))  # the last one stays: that of no word
    some = np.zeros(len(codes), np.int8)
    if len(used) != 1 or int(codes.min()) == NONE:
        some = places[codes[order]]
    mask = some == NONE
    indices = pa.array(some, mask=mask if mask.any() else None)
    return pa.DictionaryArray.from_arrays(indices, pa.array([words[each] for each in used], pa.string()))


def _coded(column: pa.ChunkedArray) -> tuple[npt.NDArray[np.int32], pa.Array]:
    """Words, or keys, as places in an array of them, which is the second; NONE for no word."""
    import pyarrow as pa

    if not pa.types.is_dictionary(column.type):
        codes = np.arange(len(column), dtype=np.int32)
        if column.null_count:
            codes[column.is_null().to_numpy()] = NONE
        return codes, column.combine_chunks()
    together = column.unify_dictionaries().combine_chunks()
    codes = _filled(together.indices.cast(pa.int32()), NONE).to_numpy()
    return codes, together.dictionary


def _codes(table: pa.Table, name: str, words: tuple[str, ...]) -> Codes:
    codes, there = _coded(table.column(name))
    found: Codes = np.array([*(_code(each, name, words) for each in there.to_pylist()), NONE], np.int8)[codes]
    return found


def _code(word: str | None, name: str, words: tuple[str, ...]) -> np.int8:
    """The place of a word of a column in a list, NONE for no word; ValueError for one that is not in it."""
    if word is None:
        return np.int8(NONE)
    if word not in words:
        raise ValueError(f"column {name} has an unknown word")
    return np.int8(words.index(word))


def _integers(table: pa.Table, name: str, none: int) -> Integers:
    import pyarrow as pa

    column = table.column(name)
    if column.null_count == len(column):
        return _constant(none, len(column))
    found: Integers = _filled(column.cast(pa.int64()), none).to_numpy()
    return found


def _constant(value: int, count: int) -> Integers:
    """So many times the same number, without memory for each."""
    return np.broadcast_to(np.int64(value), count)


def _filled(values: Any, none: float) -> Any:
    return values.fill_null(none) if values.null_count else values


def _sorted(columns: SegmentColumns, group_rows: int) -> tuple[Rows, pa.Array | pa.ChunkedArray, int]:
    """The rows by key, then revision and place, those without a key last; their keys; how many strings these are."""
    import pyarrow as pa

    with_key, rest = np.flatnonzero(columns.keyed), np.flatnonzero(~columns.keyed)
    none = np.arange(len(columns)) >= len(with_key)
    if not isinstance(columns.keys, PackedKeys):
        by_key = np.argsort(columns.keys, kind="stable")
        integers = np.zeros(len(columns), np.uint64)
        integers[: len(with_key)] = columns.keys[by_key]
        return np.concatenate([with_key[by_key], rest]), pa.array(integers, mask=none), 0
    ranks, names = _ranked(columns.keys)
    by_key = np.argsort(ranks, kind="stable")
    key = _keys_of_groups(ranks[by_key], names, len(columns), group_rows)
    return np.concatenate([with_key[by_key], rest]), key, len(names)


def _keys_of_groups(ranks: npt.NDArray[Any], names: pa.Array, count: int, group_rows: int) -> pa.ChunkedArray:
    """Keys in order, those of each group of rows as places in a list of its own; the rows after these have none."""
    import pyarrow as pa

    chunks = []
    for first in range(0, count, group_rows):
        places = np.full(min(group_rows, count - first), NONE, np.int32)
        some = ranks[first : first + group_rows]
        least = int(some[0]) if len(some) else 0
        places[: len(some)] = some
        places[: len(some)] -= least
        mask = places == NONE if len(some) < len(places) else None
        own = names.slice(least, int(some[-1]) - least + 1 if len(some) else 0)
        chunks.append(pa.DictionaryArray.from_arrays(pa.array(places, mask=mask), own))
    return pa.chunked_array(chunks, pa.dictionary(pa.int32(), pa.string()))


def _ranked(keys: PackedKeys) -> tuple[npt.NDArray[Any], pa.Array]:
    """For each key its place among the different ones in order, and these: few strings are compared."""
    import pyarrow as pa
    import pyarrow.compute as pc

    codes = key_codes(keys)
    newest = np.zeros(int(codes.max(initial=-1)) + 1, np.intp)
    newest[codes] = np.arange(len(codes))
    some = np.zeros(len(codes), np.bool_)
    some[newest] = True
    different = select_keys(keys, some)
    assert isinstance(different, PackedKeys)  # as `keys`
    offsets = np.concatenate(
        [[0], np.cumsum(np.frombuffer(different.lengths, np.uint8), dtype=np.int32)], dtype=np.int32
    )
    buffers = [None, pa.py_buffer(offsets), pa.py_buffer(different.data)]
    names = pa.Array.from_buffers(pa.string(), len(newest), buffers)
    in_order = pc.array_sort_indices(names)
    # Numbers of two bytes are sorted in time O(n).
    rank = np.zeros(len(newest), np.uint16 if len(newest) <= 2**16 else np.uint32)
    rank[codes[some][in_order.to_numpy()]] = np.arange(len(newest))
    return rank[codes], names.take(in_order)


def _packed(words: pa.Array, codes: npt.NDArray[np.int32], identity: Identity) -> Keys:
    """The keys at some places of an array."""
    import pyarrow as pa

    there = words.cast(pa.uint64() if identity == "int" else pa.string())
    if len(codes) != len(there) or not np.array_equal(codes, np.arange(len(there), dtype=np.int32)):
        there = there.take(pa.array(codes))
    if identity == "int":
        integers: npt.NDArray[np.uint64] = there.to_numpy(zero_copy_only=False)
        return integers
    lengths, text = _text(there)
    return PackedKeys(lengths, bytes(text))


def _text(words: pa.Array) -> tuple[npt.NDArray[np.uint8], memoryview]:
    """The lengths of keys, and these one after the other."""
    _, offsets, data = words.buffers()
    ends = np.frombuffer(offsets, np.int32, len(words) + 1, 4 * words.offset) if offsets else np.zeros(1, np.int32)
    text = memoryview(b"" if data is None else data)
    return np.diff(ends).astype(np.uint8), text[ends[0] : ends[-1]]


def _scaled(values: npt.NDArray[np.float64], there: npt.NDArray[np.bool_], order: Rows) -> tuple[pa.Array, int | None]:
    """Coordinates in an order as whole numbers, and what to divide them by; as doubles, if some would differ."""
    import pyarrow as pa

    every = bool(there.all())
    some = np.ascontiguousarray(values) if every else values[there]
    mask = None if every else ~there[order]
    for scale in (10**places for places in range(MOST_PLACES + 1)):
        if _as_whole(some[:SAMPLE], scale) is not None and (whole := _as_whole(some, scale)) is not None:
            if not every:
                column = np.zeros(len(values), np.int64)
                column[there] = whole
                whole = column
            return pa.array(whole[order], mask=mask), scale
    return pa.array(values[order], mask=mask), None


def _as_whole(values: npt.NDArray[np.float64], scale: int) -> Integers | None:
    """Numbers times a scale, if dividing these gives the same numbers bit for bit; otherwise None."""
    with np.errstate(over="ignore"):
        whole = np.rint(values * scale)
    if not bool((np.abs(whole) < EXACT).all()):
        return None
    back = whole.astype(np.int64) / scale
    return whole.astype(np.int64) if np.array_equal(back.view(np.int64), values.view(np.int64)) else None


def _coordinates(table: pa.Table, name: str) -> npt.NDArray[np.float64]:
    import pyarrow as pa

    column = table.column(name)
    scale = (table.schema.field(name).metadata or {}).get(SCALE)
    if scale is None:
        found: npt.NDArray[np.float64] = _filled(column.cast(pa.float64()), np.nan).to_numpy()
        return found
    whole: npt.NDArray[np.float64] = _filled(column.cast(pa.int64()), 0).to_numpy() / int(scale)
    if column.null_count:
        whole[column.is_null().to_numpy()] = np.nan
    return whole
