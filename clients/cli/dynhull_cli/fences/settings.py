"""`dynhull fences create` and `dynhull fences replace`."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from dynhull_surface.settings import FenceSettings

from ..completion import fences
from ..connected import AsJson, connected
from ..json_lines import json_line
from ..listing import made
from ..setting_options import choosing, settings_options

if TYPE_CHECKING:
    from dynhull_client import Fence, HullClient


def _area(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Area: one of", **more)


def _subjects(text: str, *names: str, **more: Any) -> Any:
    return typer.Option(*names, help=text, rich_help_panel="Subjects: one of", **more)


FenceName = Annotated[str, typer.Argument(metavar="FENCE", help="Name of the fence.", autocompletion=fences)]
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
Expected = Annotated[
    list[str] | None,
    typer.Option(
        metavar="KEY",
        help="A key that should be inside by --expected-by or --expected-within; may be given several times.",
    ),
]
OtherHull = Annotated[
    str | None, _subjects("A hull as a whole: does it intersect --area, or is it near?", metavar="HULL")
]


def compared(
    area: Area = None,
    polygon: PolygonText = None,
    circle: CircleNumbers = None,
    subjects: Subjects = None,
    subject_prefix: SubjectPrefix = None,
    other_hull: OtherHull = None,
    expected: Expected = None,
) -> dict[str, Any]:
    """The area and the subjects as arguments of the SDK; ValueError names what is missing or too much."""
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
        "expected": expected or None,
    }


def with_keys(client: "HullClient", chosen: dict[str, Any]) -> dict[str, Any]:
    """The arguments with the expected keys of the kind that the hull of the subjects has."""
    from ..keyed_rows import keys_for

    if chosen["expected"] is None or not isinstance(chosen["subjects"], str):
        return chosen
    return chosen | {"expected": keys_for(client, chosen["subjects"], chosen["expected"])}


@connected
@choosing(compared, settings_options(FenceSettings))
def create(
    client: "HullClient",
    name: FenceName,
    chosen: dict[str, Any],
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

    chosen = with_keys(client, chosen)
    fence, created = made(client.create_fence, FenceExistsError, exist_ok=exist_ok, name=name, **chosen)
    _remark_on_degrees(client, fence)
    _print(fence, "created" if created else "exists", as_json)


@connected
@choosing(compared, settings_options(FenceSettings, creating=False))
def replace(client: "HullClient", name: FenceName, chosen: dict[str, Any], as_json: AsJson = False) -> None:
    """Replace the area and all settings of a fence. The subjects must stay the same.

        dynhull fences replace depot --polygon depot.geojson --subjects vehicles

    Subjects that are inside of one area and outside of the other enter or leave, with the cause fence_changed.
    """
    fence = client.replace_fence(name, **with_keys(client, chosen))
    _remark_on_degrees(client, fence)
    _print(fence, "replaced", as_json)


def _remark_on_degrees(client: "HullClient", fence: "Fence") -> None:
    """Say so if a circle of the plane seems to be meant in degrees and metres."""
    from dynhull_client import Circle

    area = fence.area
    if not isinstance(area, Circle) or abs(area.x) > 180 or abs(area.y) > 90 or area.r <= 360:
        return
    from .shown import is_geographic

    if is_geographic(client, fence) is False:
        typer.echo(
            f"{fence.name} is in the plane, where {area.r:g} is in the units of x and y: if these are degrees, "
            "`dynhull create NAME --geographic` makes a hull on the globe, where the radius is in metres",
            err=True,
        )


def _require_one(*options: tuple[str, Any]) -> None:
    given = [name for name, value in options if value is not None]
    if len(given) != 1:
        names = [name for name, _ in options]
        found = " and ".join(given) if given else "none of them"
        raise ValueError(f"give one of {', '.join(names[:-1])} and {names[-1]}, got {found}")


def _print(fence: "Fence", done: str, as_json: bool) -> None:
    from .shown import fence_members

    typer.echo(json_line(**fence_members(fence)) if as_json else f"{fence.name}: {done}, {fence.inside} inside")
