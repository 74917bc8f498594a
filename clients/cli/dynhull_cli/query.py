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

SIDES = {1: "inside", 0: "boundary", -1: "outside", -128: "missing"}


class Question(StrEnum):
    """The questions of `dynhull query`."""

    LOCATE = "locate"
    COUNT = "count"
    DISTANCE = "distance"
    SUPPORT = "support"
    TANGENTS = "tangents"
    LINES = "lines"
    POSITIONS = "positions"
    VERTICES = "vertices"


ANSWERS: "dict[Question, Callable[[HullClient, str, Points], list[Any]]]" = {
    Question.LOCATE: lambda client, name, xy: [SIDES[each] for each in client.locate(name, xy).sides.tolist()],
    Question.COUNT: lambda client, name, xy: client.count(name, xy).counts.tolist(),
    Question.DISTANCE: lambda client, name, xy: client.distance(name, xy).distances.tolist(),
    Question.SUPPORT: lambda client, name, xy: client.support(name, xy).vertices.tolist(),
    Question.TANGENTS: lambda client, name, xy: client.tangents(name, xy).tangents.tolist(),
    Question.LINES: lambda client, name, pq: client.intersect_lines(name, pq[:, :2], pq[:, 2:]).crossings.tolist(),
}


ABOUT_KEYS = (Question.LOCATE, Question.DISTANCE)


@connected
def query(
    client: "HullClient",
    name: HullName,
    question: Annotated[
        Question, typer.Argument(metavar="QUESTION", help="One of the questions above.")
    ] = Question.VERTICES,
    points: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="X,Y|KEY",
            help="The points, X,Y,X,Y for a line; or the keys. Default, or -: lines of standard input.",
        ),
    ] = None,
    keys: Annotated[
        bool,
        typer.Option(
            "--keys", help="locate, distance: ask about keys in place of points. vertices, support: name the vertices."
        ),
    ] = False,
    keys_of: Annotated[
        str, typer.Option(metavar="HULL", help="The keyed hull that has the keys of --keys. Default: the same hull.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """Ask a hull about points: one line per point, with its coordinates and the exact answer between tabs.

        dynhull query fleet/north locate -73.9,40.7 -74.2,40.6
        dynhull query vehicles vertices --keys
        dynhull query depot locate --keys LH400 --keys-of vehicles

    * locate: inside, boundary or outside
    * count: how many copies of the point the hull holds
    * distance: how far the point is from the hull; 0 inside
    * support: the vertex that is farthest in the direction X,Y
    * tangents: the left and the right tangent point
    * lines: where the line through two points enters and leaves the hull
    * positions (with keys): where each key is; nan for a missing key
    * vertices (without points): the vertices of the hull, counter-clockwise
    """
    if keys_of and not (keys and question in ABOUT_KEYS):
        raise ValueError("--keys-of is given with --keys, to locate or distance")
    if question is Question.VERTICES:
        if points:
            raise ValueError(f"vertices takes no points, but {points[0]!r} was given")
        _vertices(client, name, keys, as_json)
    elif question is Question.POSITIONS or (keys and question in ABOUT_KEYS):
        _ask_about_keys(client, name, question, points, keys_of, as_json)
    elif keys and question is not Question.SUPPORT:
        raise ValueError(f"{question} is about points: --keys is for locate, distance, positions, support and vertices")
    else:
        _ask_about_points(client, name, question, points, keys, as_json)


def _vertices(client: "HullClient", name: str, named: bool, as_json: bool) -> None:
    hull = client.get_hull(name)
    if named and hull.vertex_keys is None:
        raise ValueError(f"the points of {name!r} have no keys: leave out --keys")
    for key, vertex in zip(hull.vertex_keys or [None] * len(hull.vertices), hull.vertices.tolist(), strict=True):
        if as_json:
            typer.echo(json_line(vertex=vertex, key=key) if named else json_line(vertex=vertex))
        else:
            typer.echo(tab_line(vertex, key) if named else tab_line(vertex))


def _ask_about_keys(
    client: "HullClient", name: str, question: Question, arguments: list[str] | None, keys_of: str, as_json: bool
) -> None:
    from .keyed_rows import given_keys, keys_for

    keys = keys_for(client, keys_of or name, given_keys(arguments))
    if question is Question.POSITIONS:
        answers = client.positions(name, keys).positions.tolist()
    elif question is Question.DISTANCE:
        answers = client.distance(name, keys=keys, keys_of=keys_of).distances.tolist()
    else:
        answers = [SIDES[each] for each in client.locate(name, keys=keys, keys_of=keys_of).sides.tolist()]
    for key, answer in zip(keys, answers, strict=True):
        typer.echo(json_line(asked=key, answer=answer) if as_json else tab_line(key, answer))


def _ask_about_points(
    client: "HullClient", name: str, question: Question, arguments: list[str] | None, named: bool, as_json: bool
) -> None:
    from .rows import given_or_read, number_rows

    for rows in number_rows(given_or_read(arguments), 4 if question is Question.LINES else 2):
        answers: list[Any]
        if named:
            found = client.support(name, rows, keys=True)
            answers = list(zip(found.vertices.tolist(), found.keys or (), strict=True))
        else:
            answers = ANSWERS[question](client, name, rows)
        for row, answer in zip(rows.tolist(), answers, strict=True):
            typer.echo(json_line(asked=row, answer=answer) if as_json else tab_line(row, answer))


# A point may begin with a minus sign.
query.context_settings = {"ignore_unknown_options": True}  # type: ignore[attr-defined]
