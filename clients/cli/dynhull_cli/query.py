"""`dynhull query`: questions about points, answered by a hull."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .connected import AsJson, HullName, connected
from .json_lines import json_line
from .tab_lines import tab_line

if TYPE_CHECKING:
    from collections.abc import Callable

    from dynhull_client import HullClient, Points

SIDES = {1: "inside", 0: "boundary", -1: "outside"}


class Question(StrEnum):
    """The questions of `dynhull query`."""

    LOCATE = "locate"
    COUNT = "count"
    DISTANCE = "distance"
    SUPPORT = "support"
    TANGENTS = "tangents"
    LINES = "lines"
    VERTICES = "vertices"


ANSWERS: "dict[Question, Callable[[HullClient, str, Points], list[Any]]]" = {
    Question.LOCATE: lambda client, name, xy: [SIDES[each] for each in client.locate(name, xy).sides.tolist()],
    Question.COUNT: lambda client, name, xy: client.count(name, xy).counts.tolist(),
    Question.DISTANCE: lambda client, name, xy: client.distance(name, xy).distances.tolist(),
    Question.SUPPORT: lambda client, name, xy: client.support(name, xy).vertices.tolist(),
    Question.TANGENTS: lambda client, name, xy: client.tangents(name, xy).tangents.tolist(),
    Question.LINES: lambda client, name, pq: client.intersect_lines(name, pq[:, :2], pq[:, 2:]).crossings.tolist(),
}


@connected
def query(
    client: "HullClient",
    name: HullName,
    question: Annotated[
        Question, typer.Argument(metavar="QUESTION", help="One of the questions above.")
    ] = Question.VERTICES,
    points: Annotated[
        list[str] | None,
        typer.Argument(metavar="X,Y", help="The points; X,Y,X,Y for a line. Default, or -: lines of standard input."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Ask a hull about points: one line per point, with its coordinates and the exact answer between tabs.

        dynhull query fleet/north locate -73.9,40.7 -74.2,40.6

    * locate: inside, boundary or outside
    * count: how many copies of the point the hull holds
    * distance: how far the point is from the hull; 0 inside
    * support: the vertex that is farthest in the direction X,Y
    * tangents: the left and the right tangent point
    * lines: where the line through two points enters and leaves the hull
    * vertices (without points): the vertices of the hull, counter-clockwise
    """
    from .rows import given_or_read, number_rows

    if question is Question.VERTICES:
        if points:
            raise ValueError(f"vertices takes no points, but {points[0]!r} was given")
        for vertex in client.get_hull(name).vertices.tolist():
            typer.echo(json_line(vertex=vertex) if as_json else tab_line(vertex))
        return
    columns = 4 if question is Question.LINES else 2
    for rows in number_rows(given_or_read(points), columns):
        for row, answer in zip(rows.tolist(), ANSWERS[question](client, name, rows), strict=True):
            typer.echo(json_line(asked=row, answer=answer) if as_json else tab_line(row, answer))


# A point may begin with a minus sign.
query.context_settings = {"ignore_unknown_options": True}  # type: ignore[attr-defined]
