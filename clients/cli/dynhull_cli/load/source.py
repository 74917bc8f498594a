"""Where points come from: a file or standard input, in one of four formats."""

import hashlib
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import IO

from .chunks import Chunks

STANDARD_INPUT = "-"
DIGESTED_BYTES = 2**20


class Format(StrEnum):
    """What a file can be."""

    CSV = "csv"
    PARQUET = "parquet"
    GEOJSON = "geojson"
    NDJSON = "ndjson"


Reader = Callable[[str, IO[bytes], str | None, str | None], Chunks]
SUFFIXES = {f".{each}": each for each in Format} | {".jsonl": Format.NDJSON}


@dataclass(frozen=True)
class Source:
    """A file or a pipe that points are read from, once, with columns of x and y where its format has columns.

    `size` is in bytes, None for a pipe.
    """

    name: str
    file: IO[bytes]
    size: int | None
    format: Format
    x: str | None
    y: str | None

    def chunks(self) -> Chunks:
        """The points; ValueError where the file is not what it should be."""
        return _reader(self.format)(self.name, self.file, self.x, self.y)

    def done(self) -> int:
        """Bytes read so far."""
        return 0 if self.size is None else self.file.tell()

    def digest(self) -> str | None:
        """Tells the points of this file from those of any other; None for a pipe, which can be read only once."""
        if self.size is None:
            return None
        digest = hashlib.sha256()
        while part := self.file.read(DIGESTED_BYTES):
            digest.update(part)
        self.file.seek(0)
        digest.update(f"{self.format} {self.x} {self.y}".encode())
        return digest.hexdigest()


@contextmanager
def open_source(name: str, kind: Format | None, x: str | None, y: str | None) -> Iterator[Source]:
    """Open a file, or standard input for "-". Without a `kind`, the name's end tells; standard input is CSV."""
    if name == STANDARD_INPUT:
        yield Source("standard input", sys.stdin.buffer, None, kind or Format.CSV, x, y)
        return
    path = Path(name)
    if kind is None:
        if path.suffix not in SUFFIXES:
            raise ValueError(f"{name}: the name must end in {', '.join(SUFFIXES)}, or say what it is with --format")
        kind = SUFFIXES[path.suffix]
    with path.open("rb") as file:
        yield Source(name, file, path.stat().st_size, kind, x, y)


def _reader(kind: Format) -> Reader:
    """Each is loaded where it is wanted: some take long, and not everybody has pyarrow and ijson."""
    match kind:
        case Format.CSV:
            from .read_csv import read_csv

            return read_csv
        case Format.PARQUET:
            from .read_parquet import read_parquet

            return read_parquet
        case Format.GEOJSON:
            from .read_json import read_geojson

            return read_geojson
        case Format.NDJSON:
            from .read_json import read_ndjson

            return read_ndjson
