"""The contents of a hull as a file: CSV, GeoJSON or Parquet."""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from itertools import chain
from pathlib import Path
from secrets import token_hex
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import PackedKeys, key_list

from .state.records import FOREVER, NO_TIME, Contents, Times
from .storage.durable import make_durable

ROWS_A_STEP = 100_000
HALF_TURN = 180.0
LARGEST_JSON_INTEGER = 2**53  # readers with doubles for numbers round larger ones


@contextmanager
def complete_file(file: Path) -> Iterator[Path]:
    """A file for the block to write: with its end, and not before, it is on the disk under its final name."""
    target = file.resolve()  # a symbolic link stays one
    unfinished = target.with_name(f"{target.name}.unfinished-{token_hex(4)}")
    try:
        yield unfinished
        make_durable(unfinished)
        unfinished.replace(target)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise
    make_durable(target.parent)


def in_parts(contents: Contents) -> Iterator[Contents]:
    """The contents in parts for the functions below, at least one: all parts have the same columns."""
    for first in range(0, max(len(contents), 1), ROWS_A_STEP):
        rows = slice(first, first + ROWS_A_STEP)
        times, deadlines = (None if each is None else each[rows] for each in (contents.times, contents.deadlines))
        keys = None if contents.keys is None else contents.keys[rows]
        accuracies = None if contents.accuracies is None else contents.accuracies[rows]
        yield Contents(contents.points[rows], keys, times, deadlines, accuracies=accuracies)


def write_csv(file: Path, parts: Iterable[Contents], *, geographic: bool = False) -> None:
    """Write columns key, x, y (lon, lat), time, expires, accuracy, those that the hull has; string keys in quotes."""
    with file.open("w", encoding="utf-8", newline="") as out:
        first, parts = _begun(parts)
        out.write(",".join(_names(first, geographic=geographic)) + "\n")
        for part in parts:
            columns: list[list[str]] = []
            if part.keys is not None:
                columns.append(list(map(_quoted if isinstance(part.keys, PackedKeys) else str, key_list(part.keys))))
            columns += [list(map(repr, axis)) for axis in part.points.T.tolist()]
            columns += [_texts(times) for times in (part.times, part.deadlines) if times is not None]
            if part.accuracies is not None:
                columns.append(list(map(repr, part.accuracies.tolist())))
            out.writelines(",".join(row) + "\n" for row in zip(*columns, strict=True))


def write_geojson(file: Path, parts: Iterable[Contents], *, geographic: bool = False) -> None:
    """Write a feature for each point: its key as the id, and the properties time, expires and accuracy.

    Longitudes of a geographic hull beyond 180 degrees are written as the same place within (RFC 7946). Of a plane the
    coordinate reference system is null, so that readers do not take its points for longitudes and latitudes.

    Integer keys above 2**53 are written as strings, because some readers of JSON would round the numbers.
    """
    with file.open("w", encoding="utf-8") as out:
        out.write('{"type": "FeatureCollection", ' + ("" if geographic else '"crs": null, ') + '"features": [\n')
        between = ""
        for part in parts:
            for feature in _features(part, geographic=geographic):
                out.write(between + json.dumps(feature))
                between = ",\n"
        out.write("\n]}\n")


def write_parquet(file: Path, parts: Iterable[Contents], *, geographic: bool = False) -> None:
    """Write columns key (string or uint64), x, y (lon, lat), time and expires (UTC), accuracy, those that there are."""
    import pyarrow as pa  # slow to load, and only this format needs it
    import pyarrow.parquet as pq

    first, parts = _begun(parts)
    key = pa.string() if isinstance(first.keys, PackedKeys) else pa.uint64()
    types = {"key": key, **dict.fromkeys(_axes(geographic=geographic), pa.float64()), "accuracy": pa.float64()}
    time = pa.timestamp("us", tz="UTC")
    schema = pa.schema([(name, types.get(name, time)) for name in _names(first, geographic=geographic)])
    with pq.ParquetWriter(file, schema) as out:
        for part in parts:
            columns = [] if part.keys is None else [_arrow_keys(part.keys)]
            columns += [pa.array(np.ascontiguousarray(axis)) for axis in part.points.T]
            columns += [pa.array(_dates(times), time) for times in (part.times, part.deadlines) if times is not None]
            if part.accuracies is not None:
                columns.append(pa.array(part.accuracies))
            out.write_table(pa.table(columns, schema))


WRITERS = {".csv": write_csv, ".parquet": write_parquet, ".geojson": write_geojson}


def _axes(*, geographic: bool) -> tuple[str, str]:
    return ("lon", "lat") if geographic else ("x", "y")


def _names(contents: Contents, *, geographic: bool) -> list[str]:
    axes = dict.fromkeys(_axes(geographic=geographic), True)
    columns: dict[str, object] = {"key": contents.keys, **axes, "time": contents.times, "expires": contents.deadlines}
    columns["accuracy"] = contents.accuracies
    return [name for name, column in columns.items() if column is not None]


def _begun(parts: Iterable[Contents]) -> tuple[Contents, Iterable[Contents]]:
    """The first part, and all parts."""
    following = iter(parts)
    first = next(following)
    return first, chain([first], following)


def _features(part: Contents, *, geographic: bool) -> Iterator[dict[str, Any]]:
    points = (_within_180(part.points) if geographic else part.points).tolist()
    ids = [{}] * len(points) if part.keys is None else [{"id": _json_key(key)} for key in key_list(part.keys)]
    times, expires = ([""] * len(points) if each is None else _texts(each) for each in (part.times, part.deadlines))
    errors = [0.0] * len(points) if part.accuracies is None else part.accuracies.tolist()
    for point, of_key, *dates, error in zip(points, ids, times, expires, errors, strict=True):
        properties: dict[str, Any] = {name: text for name, text in zip(("time", "expires"), dates, strict=True) if text}
        if error:
            properties["accuracy"] = error
        geometry = {"type": "Point", "coordinates": point}
        yield {"type": "Feature", **of_key, "properties": properties, "geometry": geometry}


def _within_180(lonlat: Points) -> Points:
    """The same places with longitudes from -180 to 180. Exact (Sterbenz 1974)."""
    wrapped = lonlat.copy()
    wrapped[lonlat[:, 0] > HALF_TURN, 0] -= 2 * HALF_TURN
    wrapped[lonlat[:, 0] < -HALF_TURN, 0] += 2 * HALF_TURN
    return wrapped


def _quoted(text: str) -> str:
    doubled = text.replace('"', '""')
    return f'"{doubled}"'


def _json_key(key: str | int) -> str | int:
    """Integers as strings where some readers of JSON would round them."""
    return str(key) if isinstance(key, int) and key > LARGEST_JSON_INTEGER else key


def _dates(times: Times) -> npt.NDArray[np.datetime64]:
    """Times as dates; NaT where there is none."""
    return np.where(times == FOREVER, NO_TIME, times).astype("datetime64[us]")


def _texts(times: Times) -> list[str]:
    """Times by ISO 8601 in UTC; empty where there is none."""
    dates = _dates(times)
    texts = np.datetime_as_string(dates, timezone="UTC")
    return np.where(np.isnat(dates), "", texts).tolist()  # type: ignore[no-any-return]


def _arrow_keys(keys: PackedKeys | npt.NDArray[np.uint64]) -> Any:
    import pyarrow as pa

    if not isinstance(keys, PackedKeys):
        return pa.array(keys)
    ends = np.cumsum(np.frombuffer(keys.lengths, np.uint8), dtype=np.int32)
    offsets = np.concatenate([np.zeros(1, np.int32), ends])
    return pa.StringArray.from_buffers(len(keys), pa.py_buffer(offsets), pa.py_buffer(keys.data))
