"""The input of a load: a file or standard input, compressed or not, in one of several formats."""

import gzip
import hashlib
import io
import os
import sys
import zlib
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager, nullcontext
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, assert_never, cast

from ..peek import peek
from ..reading.columns import LONGITUDE_LATITUDE, are_degrees
from ..reading.labels import LabelReader
from ..reading.text import PART, UndecodableError, Utf8
from .chunks import Chunks
from .interruptible import InterruptibleInput, can_be_interrupted
from .options import STANDARD_INPUT, Format, Options
from .places import places_only

if TYPE_CHECKING:
    from dynhull.keys import KeyType

DIGESTED_BYTES = 2**20
GZIP_MARK = b"\x1f\x8b"
SUFFIXES = {f".{each}": each for each in Format} | {
    ".txt": Format.CSV,
    ".jsonl": Format.NDJSON,
    ".kmz": Format.KML,
    ".zip": Format.SHP,
}
TABLES = {Format.CSV, Format.TSV}
JSON = {Format.JSON, Format.GEOJSON, Format.NDJSON}
LAYERS = {Format.GPKG, Format.SHP, Format.FGB, Format.GPX, Format.KML, Format.XLSX}
BESIDE = {Format.SHP: (".dbf", ".DBF")}  # the files with the fields of a Shapefile
ROWS = set(Format) - {Format.NMEA}  # formats with columns, members or fields
APPLIES_TO = {
    "x": ROWS - {Format.GEOJSON},
    "y": ROWS - {Format.GEOJSON},
    "delimiter": {Format.CSV},
    "decimal": TABLES,
    "header": TABLES,
    "encoding": TABLES | JSON,
    "vertices": ROWS,
    "key": ROWS,
    "time": ROWS,
    "time_unit": ROWS,
    "expires": ROWS,
    "layer": LAYERS,
    "geometry": ROWS - {Format.GEOJSON},
    "time_zone": ROWS,
    "ambiguous": ROWS,
    "time_format": ROWS,
    "accuracy": ROWS,
}


@dataclass(frozen=True)
class Source:
    """An input that is read once.

    Attributes:
        name: its name in messages.
        file: its bytes, decompressed; `peek` can look ahead in it.
        compressed: the bytes as they are stored.
        size: how many these are; None for a pipe.
        format: its format.
        options: how to read it.
        integer_keys: whether keys are integers.
        keep_bytes: whether rows with bytes that are none of the encoding are bad rows; otherwise the first one is an
            error. Documents of JSON have no such rows.
        notes: lines about what was detected while reading and may surprise.
        asked: whether the options say that the points are places on the globe; None if they do not say.
        elsewhere: the coordinate reference systems that it names and that are no degrees.
        axes: the names of the columns of x and y, once they are known; empty for geometries that are not in degrees.
        geographic: returns whether the points are places on the globe, None if the names of the columns say so. Called
            once there are points.
    """

    name: str
    file: IO[bytes]
    compressed: IO[bytes]
    size: int | None
    format: Format
    options: Options
    integer_keys: bool = False
    keep_bytes: bool = False
    notes: list[str] = field(default_factory=list)
    asked: bool | None = None
    elsewhere: list[str] = field(default_factory=list)
    axes: list[str] = field(default_factory=list)
    geographic: Callable[[], bool | None] = lambda: None

    @property
    def degrees(self) -> bool:
        """Whether its points are longitudes and latitudes, by the names of its columns or by its format."""
        return bool(self.axes) and are_degrees(*self.axes)

    def in_degrees(self) -> None:
        """Note that its geometries are longitudes and latitudes."""
        self.axes[:] = LONGITUDE_LATITUDE

    def not_in_degrees(self, system: str) -> None:
        """Note that its geometries are in a coordinate reference system with other units."""
        if system not in self.elsewhere:
            self.elsewhere.append(system)
            self.notes.append(f"{self.name}: its coordinates are not degrees: its crs is {system}")

    def chunks(self) -> Chunks:
        """The points; those that are no places are bad rows. ValueError where the input is not of this format."""
        try:
            with closing(_reader(self.format)(self)) as chunks:
                for chunk in chunks:
                    known = self.geographic()
                    on_globe = self.degrees if known is None else known
                    if on_globe and self.elsewhere:
                        raise ValueError(
                            f"{self.name} is in {self.elsewhere[0]}, and the hull is on the globe, in degrees: "
                            "convert it, for example with ogr2ogr -t_srs EPSG:4326"
                        )
                    yield places_only(chunk, on_globe=on_globe) if on_globe or self.degrees else chunk
        except UndecodableError as error:
            has_rows = self.format in {*TABLES, Format.NDJSON} and not self.keep_bytes
            other = "; --bad-rows FILE leaves such rows out, and copies them as they are" if has_rows else ""
            raise ValueError(f"{error}: name the encoding of the file, for example --encoding cp1252{other}") from None

    def utf8(self, *, keep: bool = False) -> IO[bytes]:
        """Its text as UTF-8. With `keep`, bytes that are none of its encoding are kept if they may be."""
        text = Utf8(self.name, self.file, self.options.encoding, keep=keep and self.keep_bytes)
        return io.BufferedReader(text, PART)

    def label_reader(self) -> LabelReader | None:
        """Checks the labels of its rows; None if the options name no such column.

        The first number among the times decides their unit, which is noted, unless the options give one.
        """
        names = [column for _, column in self.options.labels]
        if not any(names):
            return None
        kind: KeyType = "int" if self.integer_keys else "str"
        return LabelReader(*names, kind=kind, form=self.options.time_form(), noted=self.notes.append)

    def rewind(self) -> None:
        """Return to the beginning; not possible with a pipe."""
        self.file.seek(0)
        self.notes.clear()
        self.axes.clear()
        self.elsewhere.clear()

    def is_file(self, path: Path) -> bool:
        """Whether that is the file that is read, perhaps by another name."""
        try:
            return os.path.samestat(os.fstat(self.compressed.fileno()), path.stat())
        except io.UnsupportedOperation:
            return False

    def done(self) -> int:
        """The number of the `size` bytes that have been read; 0 for a pipe."""
        return 0 if self.size is None else self.compressed.tell()

    def digest(self) -> str | None:
        """A name for the points of this file, the same at each load; None for a pipe, which can be read only once."""
        if self.size is None:
            return None
        digest = hashlib.sha256()
        while part := self.file.read(DIGESTED_BYTES):
            digest.update(part)
        self.file.seek(0)
        for beside in (Path(self.name).with_suffix(each) for each in BESIDE.get(self.format, ())):
            if beside.exists():
                with beside.open("rb") as more:
                    digest.update(hashlib.file_digest(more, "sha256").digest())
        # Only what differs from the default, so that a file has the name that earlier versions gave it.
        given = [f" {name}={value}" for name, value in _given(self.options).items() if name not in ("x", "y")]
        digest.update(f"{self.format} {self.options.x} {self.options.y}{''.join(given)}".encode())
        return digest.hexdigest()


Reader = Callable[[Source], Chunks]


@contextmanager
def open_source(
    name: str, kind: Format | None, options: Options, *, integer_keys: bool = False, keep_bytes: bool = False
) -> Iterator[Source]:
    """Open a file, or standard input for "-". Without a `kind`, the suffix of the name decides; standard input is CSV.

    ValueError if the format is unknown, an option does not apply to it, or the compressed data is damaged.
    """
    kind = kind or _format_of(name)
    for option in _given(options):
        if kind not in APPLIES_TO[option]:
            formats = ", ".join(each for each in Format if each in APPLIES_TO[option])
            raise ValueError(f"--{option.replace('_', '-')} is for {formats}, not for {kind}")
    try:
        if name == STANDARD_INPUT:
            raw: Any = getattr(sys.stdin.buffer, "raw", sys.stdin.buffer)
            with InterruptibleInput(raw) if can_be_interrupted(raw) else nullcontext(raw) as unbuffered:
                stdin = io.BufferedReader(unbuffered)
                try:
                    yield _source("standard input", stdin, None, kind, options, integer_keys, keep_bytes)
                finally:
                    stdin.detach()
        else:
            path = Path(name)
            with path.open("rb") as file:
                size = path.stat().st_size if path.is_file() else None
                yield _source(name, file, size, kind, options, integer_keys, keep_bytes)
    except (gzip.BadGzipFile, zlib.error, EOFError) as error:
        raise ValueError(f"{name}: the compressed data is damaged: {error}") from None


@contextmanager
def integers_of_any_size() -> Iterator[None]:
    """Lift Python's limit on the digits of integers: where int() refuses one, ijson's parser in C ends the process."""
    most_digits = sys.get_int_max_str_digits()
    sys.set_int_max_str_digits(0)
    try:
        yield
    finally:
        sys.set_int_max_str_digits(most_digits)


def _format_of(name: str) -> Format:
    if name == STANDARD_INPUT:
        return Format.CSV
    suffix = Path(name.lower().removesuffix(".gz")).suffix
    if suffix not in SUFFIXES:
        Path(name).stat()  # a file that does not exist is the first thing to report
        raise ValueError(f"{name}: the name must end in {', '.join(SUFFIXES)}; otherwise give the format with --format")
    return SUFFIXES[suffix]


def _source(
    name: str,
    stored: IO[bytes],
    size: int | None,
    kind: Format,
    options: Options,
    integer_keys: bool,
    keep_bytes: bool,
) -> Source:
    file = stored
    if peek(stored, len(GZIP_MARK)) == GZIP_MARK:
        if kind is Format.PARQUET or kind in LAYERS:
            raise ValueError(f"{name} is compressed, and {kind} is not read in order: decompress it with gunzip")
        file = cast("IO[bytes]", gzip.GzipFile(fileobj=stored))
    if not peek(file, 1):
        raise ValueError(f"{name} is empty")
    return Source(name, file, stored, size, kind, options, integer_keys, keep_bytes)


def _given(options: Options) -> dict[str, object]:
    """The options that differ from their defaults."""
    given = asdict(options)
    return {each.name: given[each.name] for each in fields(Options) if given[each.name] != each.default}


def _reader(kind: Format) -> Reader:
    """The reader of a format, imported here: some take long to import, and pyarrow and ijson may not be installed."""
    match kind:
        case Format.CSV | Format.TSV:
            from .read_csv import read_csv

            return read_csv
        case Format.PARQUET:
            from .read_parquet import read_parquet

            return read_parquet
        case Format.JSON | Format.GEOJSON:
            from .read_json import read_json

            return read_json
        case Format.NDJSON:
            from .read_json import read_ndjson

            return read_ndjson
        case Format.NMEA:
            from .read_nmea import read_nmea

            return read_nmea
        case Format.GPKG | Format.SHP | Format.FGB | Format.GPX | Format.KML | Format.XLSX:
            from .read_layer import read_layer

            return read_layer
        case _:
            assert_never(kind)
