"""Points of a layer of a file that GDAL reads, through pyogrio: GeoPackage, Shapefile, FlatGeobuf, GPX, KML, Excel."""

import struct
import zipfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyogrio

from ..peek import peek
from ..plural import plural
from ..reading.columns import coordinate_columns, geometry_column
from .arrow_rows import ArrowTable
from .chunks import CHUNK_ROWS, Chunks
from .options import Format
from .reference_system import note_reference_system
from .source import Source
from .xml_numbers import require_numbers

# GDAL chooses a driver by what is in a file, and some drivers read what the file names, of this machine or the network.
# So the file is looked at first.
MARKS = {Format.GPKG: b"SQLite format 3\0", Format.FGB: b"fgb", Format.XLSX: b"PK"}
DRIVERS = {
    Format.GPKG: {"GPKG"},
    Format.SHP: {"ESRI Shapefile"},
    Format.FGB: {"FlatGeobuf"},
    Format.GPX: {"GPX"},
    Format.KML: {"KML", "LIBKML"},
    Format.XLSX: {"XLSX"},
}
LINES_OF_POINTS = {"tracks", "routes"}  # layers of GPX; their points are layers, too
WKB_COLUMN = "wkb_geometry"  # where the layer has no name for it
UNREADABLE = RuntimeError, OSError, zipfile.BadZipFile  # the first is the base of pyogrio's errors
SHAPEFILE_HEADER = struct.Struct(">i20xi")
SHAPEFILE_MARK, WORD = 9994, 2  # bytes


def read_layer(source: Source) -> Chunks:
    """Chunks of points, a few features at a time, from the geometries of a layer, or from its columns of x and y."""
    if source.size is None:
        raise ValueError(f"{source.name} is a pipe, and {source.format} is read by GDAL: write it to a file first")
    with _explained(source):
        path = CHECKS.get(source.format, _path)(source)
        layer = _layer(source, path)
        info = pyogrio.read_info(path, layer=layer)
    if info["driver"] not in DRIVERS[source.format]:
        raise ValueError(f"{source.name} is {info['driver']}, not {source.format}")
    fields = info["fields"].tolist()
    number, geometry = info["fid_column"] or "OGC_FID", info["geometry_name"] or WKB_COLUMN
    options = source.options
    of_columns = info["geometry_type"] is None or any((options.x, options.y, options.geometry))

    def batches(columns: list[str]) -> Iterator[Any]:
        wanted = [each for each in columns if each in fields]
        read = 0
        with (
            _explained(source),
            pyogrio.raw.open_arrow(
                path,
                layer=layer,
                columns=wanted,
                read_geometry=not of_columns,
                return_fids=True,
                batch_size=CHUNK_ROWS,
                use_pyarrow=True,
                datetime_as_string=True,
            ) as (_, reader),
        ):
            for batch in reader:
                read += len(batch)
                yield batch
        if source.format is Format.FGB and read < info["features"]:  # cut within its index, it seems to have none
            raise ValueError(f"{source.name} is cut: it has {read:,} of {plural(info['features'], 'feature')}")

    unit = "row" if source.format is Format.XLSX else "feature"
    table = ArrowTable(source, [*fields, number], batches, unit, number)
    if not of_columns:
        note_reference_system(source, info["crs"], f"the layer {layer}")
        yield from table.of_geometries(geometry, system_known=True)
    elif (column := geometry_column(source.name, fields, options.x, options.y, options.geometry)) is not None:
        yield from table.of_geometries(column, system_known=False)
    else:
        x, y = coordinate_columns(source.name, fields, options.x, options.y)
        yield from table.of_columns(fields[x], fields[y])


def _layer(source: Source, path: str) -> str:
    """The layer that was chosen, or the only one that has features; ValueError where there are several."""
    kinds = {str(name): kind for name, kind in pyogrio.list_layers(path)}
    wanted = source.options.layer
    if wanted is not None:
        if wanted not in kinds:
            raise ValueError(f"{source.name} has no layer {wanted!r}; it has {', '.join(kinds)}")
        return wanted
    names = [name for name, kind in kinds.items() if kind is not None] or list(kinds)
    if source.format is Format.GPX:
        names = [name for name in names if name not in LINES_OF_POINTS]
    if len(names) > 1:
        names = [name for name in names if _has_features(path, name)] or names[:1]
    if len(names) > 1:
        raise ValueError(f"{source.name} has several layers: choose one with --layer: {', '.join(names)}")
    if not names:
        raise ValueError(f"{source.name} has no layers")
    if len(kinds) > 1:
        source.notes.append(f"{source.name}: points from the layer {names[0]}")
    return names[0]


def _has_features(path: str, layer: str) -> bool:
    fids, _ = pyogrio.raw.read(path, layer=layer, columns=[], read_geometry=False, return_fids=True, max_features=1)[
        1:3
    ]
    return len(fids) > 0


@contextmanager
def _explained(source: Source) -> Iterator[None]:
    """ValueError with the name of the file for what GDAL cannot read."""
    try:
        yield
    except UNREADABLE as error:
        problem, _, _ = str(error).replace("\n", " ").partition("; It might help")
        raise ValueError(f"{source.name} cannot be read as {source.format}: {problem}") from None


def _path(source: Source) -> str:
    """The path; ValueError where the file does not begin as those of its format."""
    mark = MARKS.get(source.format, b"")
    if peek(source.file, len(mark)) != mark:
        raise ValueError(f"{source.name} is not {source.format}")
    return str(Path(source.name).resolve())


def _shapefile(source: Source) -> str:
    """The path of a Shapefile, alone or in a zip archive; ValueError where its parts are missing or cut."""
    path = Path(source.name).resolve()
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            names = [each for each in archive.namelist() if each.lower().endswith(".shp") and not each.startswith("__")]
        if not names:
            raise ValueError(f"{source.name} has no .shp file in it")
        folders = {each.rpartition("/")[0] for each in names}
        if len(folders) > 1:
            raise ValueError(f"{source.name} has Shapefiles in several folders: unpack it, and load one of them")
        return f"/vsizip/{path}/{folders.pop()}".rstrip("/")
    header = source.file.read(SHAPEFILE_HEADER.size)
    mark, words = SHAPEFILE_HEADER.unpack(header) if len(header) == SHAPEFILE_HEADER.size else (None, 0)
    if mark != SHAPEFILE_MARK:
        raise ValueError(f"{source.name} is not a Shapefile")
    if source.size is not None and source.size < words * WORD:
        raise ValueError(f"{source.name} is cut: it has {source.size:,} of {words * WORD:,} bytes")
    if not any(path.with_suffix(each).exists() for each in (".shx", ".SHX")):
        raise ValueError(
            f"{source.name}: the .shx file beside it is missing; "
            "`ogrinfo --config SHAPE_RESTORE_SHX YES FILE.shp` makes it anew"
        )
    return str(path)


def _xml(source: Source) -> str:
    """The path; ValueError where a document is no GPX or KML to its end, or a coordinate in it is no number."""
    path = _path(source)
    if zipfile.is_zipfile(path):
        with zipfile.ZipFile(path) as archive:
            for name in archive.namelist():
                if name.lower().endswith(".kml"):
                    with archive.open(name) as document:
                        require_numbers(f"{source.name}, {name}", document, source.format)
    else:
        require_numbers(source.name, source.file, source.format)
    return path


CHECKS: dict[Format, Callable[[Source], str]] = {Format.SHP: _shapefile, Format.GPX: _xml, Format.KML: _xml}
