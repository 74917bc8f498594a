"""The command: `dynhull load`."""

import dataclasses
import sys
from functools import cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..conditions import ONLY, TTL, Only, conditions
from ..connected import AsJson, connected
from ..json_lines import json_line
from ..plural import plural
from ..reading.time_forms import AMBIGUOUS, FORMAT, ZONE, Ambiguous, TimeUnit
from .options import STANDARD_INPUT, Format, Options

if TYPE_CHECKING:
    from dynhull_client import HullClient, HullInfo

    from .sending import Sending


def _input(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Input", **more)


@connected
def load(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull; created if there is none.")],
    file: Annotated[
        str | None,
        typer.Argument(
            metavar="FILE",
            help="A .csv, .tsv, .txt, .parquet, .json, .geojson, .ndjson, .gpkg, .shp, .zip, .fgb, .gpx, .kml, .xlsx "
            "or .nmea file. Default, or -: standard input.",
        ),
    ] = None,
    format: Annotated[  # noqa: A002
        Format | None, _input("Format. Default: by the name of the file; csv for standard input.")
    ] = None,
    x: Annotated[
        str | None,
        _input(
            "Column of x, by name or by number from 1. Default: x, lon, lng, long, longitude, easting or e; or GPS_LON "
            "and the like."
        ),
    ] = None,
    y: Annotated[
        str | None, _input("Column of y. Default: y, lat, latitude, northing or n, or GPS_LAT and the like.")
    ] = None,
    delimiter: Annotated[
        str | None, _input("Character between the columns of CSV, or tab or space. Default: found in the first lines.")
    ] = None,
    decimal: Annotated[
        str | None,
        _input(
            "Decimal mark of CSV. Default: a point; a comma if the numbers have one and no comma separates columns."
        ),
    ] = None,
    header: Annotated[
        bool | None,
        _input(
            "Whether the first row of CSV names the columns. Default: yes, unless it has numbers.", show_default=False
        ),
    ] = None,
    encoding: Annotated[
        str | None,
        _input("Encoding of the file, such as cp1252. Default: UTF-8, or UTF-16 or UTF-32 with a byte order mark."),
    ] = None,
    vertices: Annotated[
        bool,
        _input("Take the vertices of lines, polygons and Multi-geometries as points.", "--vertices"),
    ] = False,
    key: Annotated[
        str | None, _input("Column of keys, which the points get; a row whose key is known moves it. GeoJSON: or id.")
    ] = None,
    time: Annotated[
        str | None,
        _input("Column of event times: ISO 8601 with a time zone, or numbers since 1970."),
    ] = None,
    time_unit: Annotated[
        TimeUnit | None, _input("Unit of times that are numbers. Default: by the size of the first one; printed.")
    ] = None,
    time_zone: Annotated[str | None, _input(ZONE)] = None,
    ambiguous: Annotated[Ambiguous, _input(AMBIGUOUS)] = Ambiguous.REFUSE,
    time_format: Annotated[str | None, _input(FORMAT)] = None,
    expires: Annotated[
        str | None,
        _input("Column of the times at which keys leave the hull, written like --time; empty for never. With --key."),
    ] = None,
    accuracy: Annotated[
        str | None,
        _input(
            "Column of the accuracies of positions, in units of the coordinates, or metres on the globe; empty for "
            "none. With --key."
        ),
    ] = None,
    only: Annotated[Only | None, _input(ONLY)] = None,
    ttl: Annotated[str | None, _input(TTL)] = None,
    geometry: Annotated[
        str | None,
        _input("Column of geometries, WKT or WKB. Default: geometry, geom, wkt or the like, where no x and y are."),
    ] = None,
    layer: Annotated[
        str | None, _input("Layer or sheet of a file of a GIS or Excel. Default: the only one that has features.")
    ] = None,
    geographic: Annotated[
        bool | None,
        typer.Option(
            "--geographic/--plane",
            help="Whether a new hull is on the globe, in degrees, or in the plane. Default: on the globe if the "
            "columns are named lon and lat, or the like, and for GeoJSON.",
            show_default=False,
        ),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Read everything and report it. Needs no server and changes nothing.")
    ] = False,
    replace: Annotated[
        bool, typer.Option("--replace", help="Delete the hull first, once all of the file has been read without error.")
    ] = False,
    resume: Annotated[bool, typer.Option("--resume", help="Continue an interrupted load of the same file.")] = False,
    again: Annotated[
        bool, typer.Option("--again", help="Add the points of a file once more that was loaded before.")
    ] = False,
    producer: Annotated[
        str | None, typer.Option(help="Name of the load, for --resume. Default: made from the contents of the file.")
    ] = None,
    bad_rows: Annotated[
        Path | None,
        typer.Option(
            help="CSV file to write the bad rows to. Rows of CSV and NDJSON with bytes that are none of the encoding "
            "are among them; otherwise they end the load.",
            dir_okay=False,
        ),
    ] = None,
    max_bad: Annotated[
        int | None, typer.Option(min=0, help="Stop if there are more bad rows than this. Default: never.")
    ] = None,
    patience: Annotated[float, typer.Option(min=0, help="Seconds to wait for a server that does not answer.")] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Add the points of a file or a pipe to a hull, each exactly once.

        dynhull load places places.csv.gz --x longitude --y latitude --bad-rows bad.csv

    Files may be compressed with gzip. Rows that are not points are counted, shown and left out. After an interruption
    of any kind, --resume continues where the load stopped: no point is lost, none is added twice. A file that was
    loaded before is refused unless --again or --replace is given. Memory does not grow with the file.

    While --replace loads, readers see the hull without points, then with a part of them.

        dynhull create vehicles --keyed str --max-age 30m --clock data
        dynhull load vehicles positions.csv --key id --time seen

    With --key, each row puts its key: a row for a known key moves it, and rows are applied in the order of the file. A
    missing hull is created with keys that are strings; create it before the load if it shall have other settings.

    A missing hull is created on the globe if the columns are named lon and lat, or longitude and latitude, and for
    GeoJSON: its edges are great circles, and its points within 85 degrees of a centre, which the first points choose.
    """
    from ..keyed_rows import known_hull
    from .bad_rows import BadRows, open_bad_rows
    from .loading import hull_if_served, load_points, producer_name, report_reading, require_readable
    from .refusals import Expected
    from .source import integers_of_any_size, open_source

    _check(decimal, replace=replace, resume=resume, again=again)
    if time is None and expires is None:
        _refuse_forms({"--time-unit": time_unit, "--time-zone": time_zone, "--time-format": time_format})
    of_puts = conditions(only, ttl, key=key, expires=expires, accuracy=accuracy)
    options = Options(
        x,
        y,
        delimiter,
        decimal,
        header,
        encoding,
        vertices,
        key,
        time,
        time_unit,
        expires,
        layer,
        geometry,
        time_zone=time_zone,
        ambiguous=ambiguous,
        time_format=time_format,
        accuracy=accuracy,
    )
    options.time_form()  # what is wrong with it is said before the file is opened
    if file is None and sys.stdin.isatty():
        raise ValueError("no file: give its name, or - to type the points in")
    there = cache(partial(hull_if_served if dry_run else known_hull, client, name))
    integers = key is not None and _has_integer_keys(there(), name)
    with (
        integers_of_any_size(),
        open_source(
            STANDARD_INPUT if file is None else file,
            format,
            options,
            integer_keys=integers,
            keep_bytes=bad_rows is not None,
        ) as opened,
        open_bad_rows(bad_rows, opened) as bad_file,
    ):
        bad = BadRows(opened.name, bad_file, max_bad)
        known = (lambda: None) if replace else there
        source = dataclasses.replace(opened, asked=geographic, geographic=lambda: _frame(known(), geographic))

        def expected() -> Expected:
            on_globe = source.geographic()
            return Expected(known(), on_globe=source.degrees if on_globe is None else on_globe)

        if dry_run:
            report_reading(name, source, bad, expected, as_json)
            return
        if replace:
            require_readable(source, max_bad, expected)
        producer = producer or (None if again else producer_name(source))
        if resume and producer is None:
            raise ValueError(f"{source.name} has no name to resume by: give --producer NAME, the same each time")
        sending = load_points(
            client,
            name,
            source,
            bad,
            producer,
            patience,
            known=known,
            geographic=geographic,
            resume=resume,
            replace=replace,
            conditions=of_puts,
        )
    _report(name, sending, bad.count, as_json)


def _report(name: str, sending: "Sending", bad_rows: int, as_json: bool) -> None:
    loaded, counts, points = sending.counts.taken, sending.counts, sending.points
    if as_json:
        typer.echo(json_line(name=name, loaded=loaded, bad_rows=bad_rows, points=points, **counts))
    else:
        more = f" ({counts})" if str(counts) else ""
        there = "" if points is None else f", {points:,} in the hull"
        typer.echo(f"{name}: {plural(loaded, 'point')} loaded{more}{there}")


def _refuse_forms(options: dict[str, object]) -> None:
    """Raise ValueError for an option about the form of times, of which there are none."""
    for option, value in options.items():
        if value is not None:
            raise ValueError(f"{option} is given with --time or --expires")


def _has_integer_keys(known: "HullInfo | None", name: str) -> bool:
    """Whether the keys of the hull are integers. ValueError if it has none."""
    if known is not None and known.keyed is None:
        raise ValueError(f"the points of {name!r} have no keys: leave out --key, or load into another hull")
    return known is not None and known.keyed == "int"


def _frame(known: "HullInfo | None", geographic: bool | None) -> bool | None:
    """Whether an existing hull is geographic; what was asked for if there is none."""
    return geographic if known is None else known.geographic


def _check(decimal: str | None, *, replace: bool, resume: bool, again: bool) -> None:
    if replace + resume + again > 1:
        raise ValueError("--resume continues a load, --again and --replace begin another: give one of them")
    if decimal not in (None, ".", ","):
        raise ValueError(f"--decimal {decimal!r} is neither . nor ,")
