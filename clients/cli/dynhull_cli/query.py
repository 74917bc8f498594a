"""`dynhull query`: questions about points, answered by a hull."""

from enum import StrEnum
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .as_of import At, as_of
from .connected import AsJson, HullName, connected
from .json_lines import json_line
from .listing import listed
from .tab_lines import tab_line

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

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
    LAYERS = "layers"
    INFLUENCE = "influence"


ANSWERS: "dict[Question, Callable[[Any, Points, int], list[Any]]]" = {
    Question.LOCATE: lambda hull, xy, layer: [SIDES[each] for each in hull.locate(xy, layer=layer).sides.tolist()],
    Question.COUNT: lambda hull, xy, _: hull.count(xy).counts.tolist(),
    Question.DISTANCE: lambda hull, xy, layer: hull.distance(xy, layer=layer).distances.tolist(),
    Question.SUPPORT: lambda hull, xy, layer: hull.support(xy, layer=layer).vertices.tolist(),
    Question.TANGENTS: lambda hull, xy, layer: hull.tangents(xy, layer=layer).tangents.tolist(),
    Question.LINES: lambda hull, pq, layer: hull.intersect_lines(pq[:, :2], pq[:, 2:], layer=layer).crossings.tolist(),
}


ABOUT_KEYS = (Question.LOCATE, Question.DISTANCE)
WITHOUT_POINTS = (Question.VERTICES, Question.LAYERS, Question.INFLUENCE)
NAMING = (Question.SUPPORT, *WITHOUT_POINTS)
WITHOUT_LAYER = (Question.COUNT, Question.POSITIONS, Question.LAYERS, Question.INFLUENCE)
DEFAULT_LAYERS = 10


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
            "--keys",
            help="locate, distance: ask about keys in place of points. vertices, support, layers, influence: name the "
            "vertices.",
        ),
    ] = False,
    keys_of: Annotated[
        str, typer.Option(metavar="HULL", help="The keyed hull that has the keys of --keys. Default: the same hull.")
    ] = "",
    layer: Annotated[
        int | None,
        typer.Option(
            min=1,
            max=1000,
            help="Ask the hull of this convex layer; 1, the default, is the hull. layers: how many; 10 by default.",
        ),
    ] = None,
    at: At = None,
    as_json: AsJson = False,
) -> None:
    """Ask a hull about points: one line per point, with its coordinates and the exact answer between tabs.

        dynhull query fleet/north locate -73.9,40.7 -74.2,40.6
        dynhull query vehicles vertices --keys
        dynhull query depot locate --keys LH400 --keys-of vehicles
        dynhull query vehicles locate --layer 2 --keys LH400
        dynhull query vehicles vertices --at 2026-11-24T16:00Z

    * locate: inside, boundary or outside
    * count: how many copies of the point the hull holds
    * distance: how far the point is from the hull; 0 inside
    * support: the vertex that is farthest in the direction X,Y
    * tangents: the left and the right tangent point
    * lines: where the line through two points enters and leaves the hull
    * positions (with keys): where each key is; nan for a missing key
    * vertices (without points): the vertices of the hull, counter-clockwise
    * layers (without points): the number and a vertex of each convex layer, from the outermost
    * influence (without points): each vertex, and the area that the hull would lose without it; the greatest first
    """
    if keys_of and at is not None:
        raise ValueError("--at is about one hull: leave out --keys-of")
    if keys_of and not (keys and question in ABOUT_KEYS):
        raise ValueError("--keys-of is given with --keys, to locate or distance")
    if layer is not None and question in WITHOUT_LAYER and question is not Question.LAYERS:
        raise ValueError(f"{question} is not about a layer, but --layer was given")
    hull = as_of(client, name, at)
    if question in WITHOUT_POINTS:
        if points:
            raise ValueError(f"{question} takes no points, but {points[0]!r} was given")
        what = f"layer {layer} of {name}" if layer and question is Question.VERTICES else name
        for row in listed(_shape(hull, name, question, keys, layer), f"{what} has no vertices"):
            typer.echo(json_line(**row) if as_json else tab_line(*row.values()))
    elif question is Question.POSITIONS or (keys and question in ABOUT_KEYS):
        _ask_about_keys(client, hull, name, question, points, keys_of, layer or 1, as_json)
    elif keys and question not in NAMING:
        names = "locate, distance, positions, support, vertices, layers and influence"
        raise ValueError(f"{question} is about points: --keys is for {names}")
    else:
        _ask_about_points(hull, question, points, keys, layer or 1, as_json)


def _shape(hull: Any, name: str, question: Question, named: bool, layer: int | None) -> "Iterator[dict[str, Any]]":
    """The rows of an answer about the hull as a whole."""
    rows: list[dict[str, Any]]
    keys: Sequence[str | int] | None
    if question is Question.LAYERS:
        peeled = hull.layers(layer or DEFAULT_LAYERS, keys=named)
        rows = [
            {"layer": number, "vertex": vertex}
            for number, vertices in enumerate(peeled.layers, start=1)
            for vertex in vertices.tolist()
        ]
        keys = None if peeled.keys is None else [key for of_layer in peeled.keys for key in of_layer]
    elif question is Question.INFLUENCE:
        found = hull.influence(keys=named)
        vertices, areas = found.vertices.tolist(), found.areas.tolist()
        order = sorted(range(len(areas)), key=lambda row: -areas[row])
        rows = [{"vertex": vertices[row], "area": areas[row]} for row in order]
        keys = None if found.keys is None else [found.keys[row] for row in order]
    else:
        found = hull.get_hull(layer=layer or 1)
        rows = [{"vertex": vertex} for vertex in found.vertices.tolist()]
        keys = found.vertex_keys
    if not named:
        yield from rows
        return
    if keys is None:
        raise ValueError(f"the points of {name!r} have no keys: leave out --keys")
    for row, key in zip(rows, keys, strict=True):
        yield {**row, "key": key}


def _ask_about_keys(
    client: "HullClient",
    hull: Any,
    name: str,
    question: Question,
    arguments: list[str] | None,
    keys_of: str,
    layer: int,
    as_json: bool,
) -> None:
    from .keyed_rows import given_keys, keys_for

    keys = keys_for(client, keys_of or name, given_keys(arguments))
    if question is Question.POSITIONS:
        found = hull.positions(keys)
        answers = found.positions.tolist()
        if as_json and found.accuracies is not None:
            for key, answer, accuracy in zip(keys, answers, found.accuracies.tolist(), strict=True):
                typer.echo(json_line(asked=key, answer=answer, accuracy=accuracy))
            return
    elif question is Question.DISTANCE:
        answers = hull.distance(keys=keys, keys_of=keys_of, layer=layer).distances.tolist()
    else:
        located = hull.locate(keys=keys, keys_of=keys_of, layer=layer)
        answers = [SIDES[each] for each in located.sides.tolist()]
    for key, answer in zip(keys, answers, strict=True):
        typer.echo(json_line(asked=key, answer=answer) if as_json else tab_line(key, answer))


def _ask_about_points(
    hull: Any,
    question: Question,
    arguments: list[str] | None,
    named: bool,
    layer: int,
    as_json: bool,
) -> None:
    from .rows import given_or_read, number_rows

    for rows in number_rows(given_or_read(arguments), 4 if question is Question.LINES else 2):
        answers: list[Any]
        if named:
            found = hull.support(rows, keys=True, layer=layer)
            answers = list(zip(found.vertices.tolist(), found.keys or (), strict=True))
        else:
            answers = ANSWERS[question](hull, rows, layer)
        for row, answer in zip(rows.tolist(), answers, strict=True):
            typer.echo(json_line(asked=row, answer=answer) if as_json else tab_line(row, answer))


# A point may begin with a minus sign.
query.context_settings = {"ignore_unknown_options": True}  # type: ignore[attr-defined]
