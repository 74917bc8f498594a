"""`dynhull insert` and `dynhull remove`: add or take away a few points. `dynhull load` reads files."""

from typing import TYPE_CHECKING, Annotated

import typer

from .connected import AsJson, HullName, connected, fail
from .exits import Exit
from .json_lines import json_line
from .plural import plural

if TYPE_CHECKING:
    from dynhull_client import Applied, HullClient, Points

Rows = Annotated[
    list[str] | None,
    typer.Argument(metavar="X,Y", help="The points. Default, or -: lines of standard input.", show_default=False),
]


@connected
def insert(client: "HullClient", name: HullName, points: Rows = None, as_json: AsJson = False) -> None:
    """Insert points into a hull, in one batch: all of them or none.

        dynhull insert fleet/north -73.9,40.7 -74.2,40.6

    A point that is inserted twice is there twice. Use `dynhull load` for files and for more than fits into one batch.
    """
    applied = client.apply(name, insert=_all_rows(points))
    _report(name, applied, f"{plural(applied.inserted, 'point')} inserted", as_json)


@connected
def remove(
    client: "HullClient",
    name: HullName,
    points: Rows = None,
    missing_ok: Annotated[bool, typer.Option("--missing-ok", help="Skip points that are not in the hull.")] = False,
    as_json: AsJson = False,
) -> None:
    """Remove points from a hull, in one batch: all of them or none.

        dynhull remove fleet/north -73.9,40.7

    Of a point that is there several times, one is removed for each time it is given.
    """
    from dynhull_client import PointMissingError

    try:
        applied = client.apply(name, delete=_all_rows(points), missing="count" if missing_ok else "raise")
    except PointMissingError as error:
        which = "a point" if error.row is None else f"point {error.row + 1}, {error.value},"
        fail(Exit.FAILED, f"{which} is not in the hull; nothing was removed. --missing-ok skips such points")
    skipped = f", {applied.missing:,} not there" if applied.missing else ""
    _report(name, applied, f"{plural(applied.deleted, 'point')} removed{skipped}", as_json)


def _all_rows(points: list[str] | None) -> "Points":
    import numpy as np

    from .rows import given_or_read, number_rows

    rows = list(number_rows(given_or_read(points)))
    if not rows:
        raise ValueError("no points: give X,Y for each of them, as arguments or as lines of standard input")
    return np.concatenate(rows)


def _report(name: str, applied: "Applied", what: str, as_json: bool) -> None:
    if as_json:
        counts = {"inserted": applied.inserted, "deleted": applied.deleted, "missing": applied.missing}
        typer.echo(
            json_line(
                name=name,
                revision=applied.revision,
                **counts,
                points=applied.points,
                hull_changed=applied.hull_changed,
            )
        )
    else:
        changed = "changed" if applied.hull_changed else "unchanged"
        typer.echo(f"{name}: {what}, {applied.points:,} in the hull, its shape {changed}")


# A point may begin with a minus sign.
insert.context_settings = remove.context_settings = {"ignore_unknown_options": True}  # type: ignore[attr-defined]
