"""`dynhull measure` and `dynhull separate`: what hulls measure, and what is between them."""

from dataclasses import asdict
from typing import Annotated, Any

import typer

from dynhull_client import HullClient

from .connected import connected
from .json_lines import json_line
from .tab_lines import tab_line


@connected
def measure(
    client: HullClient,
    name: Annotated[str, typer.Argument(help="The hull.")],
    as_json: Annotated[bool, typer.Option("--json", help="One line of JSON.")] = False,
) -> None:
    """Tell the measures of a hull: a line for each, its name and its numbers between tabs.

        dynhull measure fleet/north --json | jq .diameter

    * area, perimeter, centroid, diameter, width
    * bounds: least x, least y, greatest x, greatest y
    * min_box, min_perimeter_box: the four corners, in any direction
    * min_circle: centre and radius of the smallest circle around the points
    """
    _tell(as_json, asdict(client.get_measures(name)))


@connected
def separate(
    client: HullClient,
    name: Annotated[str, typer.Argument(help="The first hull.")],
    other: Annotated[str, typer.Argument(help="The other.")],
    as_json: Annotated[bool, typer.Option("--json", help="One line of JSON.")] = False,
) -> None:
    """Tell how two hulls lie to each other: a line for each number, its name first, tabs between.

        dynhull separate fleet/north fleet/south --json | jq .distance

    * intersect: whether they have a point in common; exact
    * distance: how far they are apart, which is the maximum margin between their points
    * depth: how far one must move to come free, where they overlap
    * normal, offset: the line halfway has the points with normal * (x, y) = offset
    * closest: the first hull's closest point and the other's; of hulls that overlap the deepest
    """
    _tell(as_json, asdict(client.separate(name, other)))


def _tell(as_json: bool, members: dict[str, Any]) -> None:
    if as_json:
        typer.echo(json_line(**members))
        return
    for member, value in members.items():
        typer.echo(tab_line(member, value))
