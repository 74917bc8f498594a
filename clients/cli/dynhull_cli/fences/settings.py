"""`dynhull fences create` and `dynhull fences replace`."""

import inspect
from collections.abc import Callable
from enum import StrEnum
from functools import wraps
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..connected import AsJson, connected
from ..durations import duration
from ..json_lines import json_line

if TYPE_CHECKING:
    from dynhull_client import Fence, HullClient


class BoundaryKind(StrEnum):
    """The side to which the boundary belongs."""

    CLOSED = "closed"
    OPEN = "open"


class InitialKind(StrEnum):
    """What a new fence says about those who are inside."""

    SNAPSHOT = "snapshot"
    EVENTS = "events"
    NONE = "none"


def _area(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Area: one of", **more)


def _subjects(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Subjects: one of", **more)


FenceName = Annotated[str, typer.Argument(metavar="FENCE", help="Name of the fence.")]
Area = Annotated[str | None, _area("A hull. The area moves as its points do.", "--area", metavar="HULL")]
PolygonText = Annotated[
    str | None,
    _area("Polygons: a file of GeoJSON or WKT, - for standard input, or WKT itself.", "--polygon", metavar="FILE|WKT"),
]
CircleNumbers = Annotated[
    tuple[float, float, float] | None,
    _area("A disk: center and radius; on the globe in degrees and metres.", "--circle", metavar="X Y R"),
]
Subjects = Annotated[str | None, _subjects("A keyed hull. Its keys are compared with the area.", metavar="HULL")]
SubjectPrefix = Annotated[
    str | None, _subjects("All keyed hulls whose names begin with this, later ones too.", metavar="PREFIX")
]
OtherHull = Annotated[
    str | None, _subjects("A hull as a whole: does it intersect --area, or is it near?", metavar="HULL")
]
Boundary = Annotated[BoundaryKind, typer.Option(help="Whether a subject on the boundary is inside (closed) or not.")]
Margin = Annotated[float, typer.Option(help="How far outside of the area a subject has to be to leave.")]
Crosses = Annotated[bool, typer.Option("--crosses", help="Report subjects that pass through between two positions.")]
Dwell = Annotated[
    str | None,
    typer.Option(help="Report subjects that stay inside for this long: 90s, 30m or 2h; a number alone is seconds."),
]
Confirmations = Annotated[
    int, typer.Option(min=0, help="Consecutive reports that must agree before a subject enters or leaves.")
]
MinDwell = Annotated[
    str | None,
    typer.Option(help="How long, as for --dwell, a subject must be on the other side before it enters or leaves."),
]
Near = Annotated[float, typer.Option(help="With --other-hull: the distance at which hulls are near.")]
WithoutSelf = Annotated[
    bool,
    typer.Option("--without-self", help="Compare each subject with the hull of the others; needs a margin."),
]
Layer = Annotated[int, typer.Option(min=1, max=1000, help="The convex layer of --area; 1 is the hull itself.")]
MaxEvents = Annotated[int, typer.Option(min=0, help="Number of events to keep; 0 for the limit of the server.")]
MaxEventAge = Annotated[
    str | None, typer.Option(help="How long events are kept: 12h or 7d; a number alone is seconds. Default: no limit.")
]


def _settings(
    area: Area = None,
    polygon: PolygonText = None,
    circle: CircleNumbers = None,
    subjects: Subjects = None,
    subject_prefix: SubjectPrefix = None,
    other_hull: OtherHull = None,
    boundary: Boundary = BoundaryKind.CLOSED,
    margin: Margin = 0.0,
    crosses: Crosses = False,
    dwell: Dwell = None,
    confirmations: Confirmations = 0,
    min_dwell: MinDwell = None,
    near: Near = 0.0,
    without_self: WithoutSelf = False,
    layer: Layer = 1,
    max_events: MaxEvents = 0,
    max_event_age: MaxEventAge = None,
) -> dict[str, Any]:
    """The arguments of the SDK for the options of both commands; ValueError names what is missing or too much."""
    from dynhull_client import Circle, Prefix

    from .areas import read_polygon

    _require_one(("--area", area), ("--polygon", polygon), ("--circle", circle))
    _require_one(("--subjects", subjects), ("--subject-prefix", subject_prefix), ("--other-hull", other_hull))
    where: Any = area
    if polygon is not None:
        where = read_polygon(polygon)
    elif circle is not None:
        where = Circle(*circle)
    return {
        "area": where,
        "subjects": Prefix(subject_prefix) if subject_prefix is not None else subjects,
        "other_hull": other_hull,
        "boundary": boundary.value,
        "margin": margin,
        "crosses": crosses,
        "dwell": duration(dwell, "--dwell"),
        "confirmations": confirmations,
        "min_dwell": duration(min_dwell, "--min-dwell"),
        "near": near,
        "without_self": without_self,
        "layer": layer,
        "max_events": max_events,
        "max_event_age": duration(max_event_age, "--max-event-age"),
    }


def _with_settings(command: Callable[..., None]) -> Callable[..., None]:
    """A command that has the options of `_settings` after its name; `command` receives what these return."""
    table = inspect.signature(_settings).parameters

    @wraps(command)
    def run(client: "HullClient", name: str, **given: Any) -> None:
        chosen = _settings(**{option: given.pop(option) for option in table})
        command(client, name, chosen, **given)

    client, name, _, *own = inspect.signature(command).parameters.values()
    run.__signature__ = inspect.Signature([client, name, *table.values(), *own])  # type: ignore[attr-defined]
    return run


@connected
@_with_settings
def create(
    client: "HullClient",
    name: FenceName,
    chosen: dict[str, Any],
    initial: Annotated[
        InitialKind, typer.Option(help="Report those who are inside at first in one event, in an enter each, or not.")
    ] = InitialKind.SNAPSHOT,
    exist_ok: Annotated[
        bool, typer.Option("--exist-ok", help="Accept a fence that exists already with the same settings.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Create a fence: it reports which subjects enter and leave an area, whichever side moves.

        dynhull fences create depot --polygon 'POLYGON ((0 0, 4 0, 4 3, 0 0))' --subjects vehicles
        dynhull fences create pack --area wolves --subjects sheep --margin 0.5

    The area is a hull, polygons or a disk; the subjects are the keys of a hull, or of all hulls with a prefix. Whether
    a subject is inside is exact.
    """
    from dynhull_client import FenceExistsError

    created = True
    try:
        fence = client.create_fence(name, **chosen, initial=initial.value)
    except FenceExistsError:
        if not exist_ok:
            raise
        fence = client.create_fence(name, **chosen, initial=initial.value, exist_ok=True)  # refuses other settings
        created = False
    _print(fence, "created" if created else "exists", as_json)


@connected
@_with_settings
def replace(client: "HullClient", name: FenceName, chosen: dict[str, Any], as_json: AsJson = False) -> None:
    """Replace the area and all settings of a fence. The subjects must stay the same.

        dynhull fences replace depot --polygon depot.geojson --subjects vehicles

    Subjects that are inside of one area and outside of the other enter or leave, with the cause fence_changed.
    """
    _print(client.replace_fence(name, **chosen), "replaced", as_json)


def _require_one(*options: tuple[str, Any]) -> None:
    given = [name for name, value in options if value is not None]
    if len(given) != 1:
        names = [name for name, _ in options]
        found = " and ".join(given) if given else "none of them"
        raise ValueError(f"give one of {', '.join(names[:-1])} and {names[-1]}, got {found}")


def _print(fence: "Fence", done: str, as_json: bool) -> None:
    from .shown import fence_members

    typer.echo(json_line(**fence_members(fence)) if as_json else f"{fence.name}: {done}, {fence.inside} inside")
