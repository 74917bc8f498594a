"""`dynhull measure` and `dynhull separate`: the measures of a hull, and the distance between two."""

from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from dynhull_client import HullClient

from .connected import AsJson, HullName, connected
from .json_lines import json_line
from .tab_lines import tab_line


@connected
def measure(client: "HullClient", name: HullName, as_json: AsJson = False) -> None:
    """Measure a hull: one line per measure, its name and its numbers between tabs.

        dynhull measure fleet/north --json | jq .diameter

    The measures are lengths and areas; bounds are least x, least y, greatest x, greatest y; boxes, the smallest ones in
    any direction, are four corners; circles are a centre and a radius.
    """
    _print(as_json, asdict(client.get_measures(name)))


@connected
def separate(
    client: "HullClient",
    name: Annotated[str, typer.Argument(metavar="HULL", help="Name of the first hull.")],
    other: Annotated[str, typer.Argument(metavar="OTHER", help="Name of the second hull.")],
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
    _print(as_json, asdict(client.separate(name, other)))


def _print(as_json: bool, members: dict[str, Any]) -> None:
    if as_json:
        typer.echo(json_line(**members))
        return
    for member, value in members.items():
        typer.echo(tab_line(member, value))
