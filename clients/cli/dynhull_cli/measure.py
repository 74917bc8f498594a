"""`dynhull measure` and `dynhull separate`: the measures of a hull, and the distance between two."""

import math
import sys
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from dynhull_client import HullClient, Series

from .as_of import At, as_of
from .completion import hulls
from .connected import AsJson, HullName, connected
from .durations import more_than_0
from .json_lines import json_line
from .tab_lines import flat, tab_line

UNITS = {"area": "m2", "perimeter": "m", "diameter": "m", "bounds": "deg", "label_point": "deg"}
LARGE = {"m": (1e3, "km"), "m2": (1e6, "km2")}
OF_A_PLANE = {"centroid", "width", "min_box", "min_perimeter_box", "min_circle"}


@connected
def measure(
    client: "HullClient",
    name: HullName,
    last: Annotated[
        str | None,
        typer.Option(
            metavar="SPAN",
            help="How the hull was over the last time, such as 30m, as far as the server keeps it, by default an "
            "hour: a line about every ten seconds in which it changed, the oldest first, and the last one of now.",
        ),
    ] = None,
    at: At = None,
    as_json: AsJson = False,
) -> None:
    """Measure a hull: one line per measure, its name, its numbers and its unit between tabs; a table on a terminal.

        dynhull measure fleet/north --json | jq .diameter

        dynhull measure fleet/north --last 1h > north.tsv

    Lengths, areas and places are in the units of the coordinates; on the globe in metres (m), square metres (m2) and
    degrees (deg). Bounds are least x, least y, greatest x, greatest y; on the globe west, south, east, north, west
    greater than east across the antimeridian. Boxes, the smallest ones in any direction, are four corners; circles are
    a centre and a radius. The label point is inside. On the globe there are no centroid, width, boxes and circle.

    With --last, a heading and lines of time, revision, points, vertices, area, perimeter, diameter, width and rate:
    revisions a second. What there is not is nan.
    """
    if last is not None and at is not None:
        raise ValueError("give --last or --at, not both")
    if last is not None:
        _print_series(client.series(name, more_than_0(last, "--last")), as_json=as_json)
        return
    found = as_of(client, name, at).get_measures()
    members = asdict(found)
    if found.geographic:
        members = {member: value for member, value in members.items() if member not in OF_A_PLANE}
    if as_json:
        typer.echo(json_line(**members))
        return
    units = UNITS if found.geographic else {}
    if sys.stdout.isatty():
        _show(name, members, units)
        return
    for member, value in members.items():
        typer.echo(tab_line(member, value, *filter(None, [units.get(member)])))


def _print_series(series: "Series", *, as_json: bool) -> None:
    columns = {
        "time": [f"{time}Z" for time in series.times],
        "revision": series.revisions,
        "points": series.points,
        "vertices": series.vertices,
        "area": series.areas,
        "perimeter": series.perimeters,
        "diameter": series.diameters,
        "width": series.widths,
        "rate": series.rates,
    }
    if not as_json:
        typer.echo(tab_line(*columns))
    for row in zip(*columns.values(), strict=True):
        typer.echo(json_line(**dict(zip(columns, row, strict=True))) if as_json else tab_line(*row))


def _show(name: str, members: dict[str, Any], units: dict[str, str]) -> None:
    from rich.console import Console
    from rich.table import Table

    where = "on the globe" if units else "in the units of the coordinates"
    table = Table("measure", "", title=f"{name} at revision {members.pop('revision'):,}, {where}")
    del members["geographic"]
    for member, value in members.items():
        table.add_row(member.replace("_", " "), _shown(value, units.get(member, "")))
    Console().print(table)


def _shown(value: Any, unit: str) -> str:
    """A measure for people: large lengths and areas of the globe in kilometres, NaN as nothing."""
    numbers = list(flat(value))
    if any(math.isnan(number) for number in numbers):
        return "none"
    size, large = LARGE.get(unit, (math.inf, ""))
    if numbers and abs(numbers[0]) >= size:
        numbers, unit = [number / size for number in numbers], large
    return " ".join([*(f"{number:,.10g}" for number in numbers), unit]).strip()


@connected
def separate(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the first hull.", autocompletion=hulls)],
    other: Annotated[str, typer.Argument(metavar="OTHER", help="Name of the second hull.", autocompletion=hulls)],
    as_json: AsJson = False,
) -> None:
    """Measure the gap or the overlap of two hulls: one line per number, its name first, tabs between.

        dynhull separate fleet/north fleet/south --json | jq .distance

    * intersect: whether they have a point in common; exact
    * distance: how far apart they are, which is the maximum margin between their points
    * depth: if they overlap, the shortest way to move one clear of the other
    * normal, offset: the line halfway between them holds the points with normal * (x, y) = offset
    * closest: the closest point of each hull; if they overlap, the deepest
    """
    members = asdict(client.separate(name, other))
    if as_json:
        typer.echo(json_line(**members))
        return
    for member, value in members.items():
        typer.echo(tab_line(member, value))
