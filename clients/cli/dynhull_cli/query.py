"""`dynhull query`: where points lie, and what lies where."""

from collections.abc import Callable
from enum import StrEnum
from typing import Annotated, Any

import typer

from dynhull_client import HullClient, Points

from .asked import STANDARD_INPUT, asked_rows
from .connected import connected
from .json_lines import json_line
from .tab_lines import tab_line

SIDES = {1: "inside", 0: "boundary", -1: "outside"}


class Question(StrEnum):
    """What can be asked."""

    LOCATE = "locate"
    COUNT = "count"
    DISTANCE = "distance"
    SUPPORT = "support"
    TANGENTS = "tangents"
    LINES = "lines"
    VERTICES = "vertices"


ANSWERS: dict[Question, Callable[[HullClient, str, Points], list[Any]]] = {
    Question.LOCATE: lambda client, name, xy: [SIDES[each] for each in client.locate(name, xy).sides.tolist()],
    Question.COUNT: lambda client, name, xy: client.count(name, xy).counts.tolist(),
    Question.DISTANCE: lambda client, name, xy: client.distance(name, xy).distances.tolist(),
    Question.SUPPORT: lambda client, name, xy: client.support(name, xy).vertices.tolist(),
    Question.TANGENTS: lambda client, name, xy: client.tangents(name, xy).tangents.tolist(),
    Question.LINES: lambda client, name, pq: client.intersect_lines(name, pq[:, :2], pq[:, 2:]).crossings.tolist(),
}


@connected
def query(
    client: HullClient,
    name: Annotated[str, typer.Argument(help="The hull.")],
    question: Annotated[Question, typer.Argument(help="What to ask.")] = Question.VERTICES,
    points: Annotated[
        list[str] | None, typer.Argument(help="X,Y each; of a line X,Y,X,Y. Default: lines of standard input.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="A line of JSON for each.")] = False,
) -> None:
    """Ask a hull about points, exactly: a line for each, with its coordinates and the answer between tabs.

        dynhull query fleet/north locate -73.9,40.7 -74.2,40.6

    * locate: inside, boundary or outside
    * count: how many times the point is there
    * distance: how far it is from the hull, 0 inside
    * support: the vertex farthest in the direction X,Y
    * tangents: the left and the right tangent point
    * lines: where the line through two points enters and leaves the hull
    * vertices: takes no points; the hull itself, counter-clockwise
    """
    if question is Question.VERTICES:
        for vertex in client.get_hull(name).vertices.tolist():
            typer.echo(json_line(vertex=vertex) if as_json else tab_line(vertex))
        return
    columns = 4 if question is Question.LINES else 2
    for asked in asked_rows(points or STANDARD_INPUT, columns):
        for row, answer in zip(asked.tolist(), ANSWERS[question](client, name, asked), strict=True):
            typer.echo(json_line(asked=row, answer=answer) if as_json else tab_line(row, answer))


# A point may begin with a minus sign.
query.context_settings = {"ignore_unknown_options": True}  # type: ignore[attr-defined]
