"""`dynhull insert`, `dynhull put` and `dynhull remove`: a few points. `dynhull load` reads files."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from dynhull_surface.counts import COUNTS, OF_CHANGES, text_of
from dynhull_surface.reasons import Exit

from .conditions import ONLY, TTL, Only
from .connected import AsJson, HullName, connected, fail
from .durations import duration
from .json_lines import json_line, members
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
def put(
    client: "HullClient",
    name: HullName,
    row: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="KEY X Y", help="A key and its position. Default, or -: lines KEY,X,Y of standard input."
        ),
    ] = None,
    time: Annotated[
        str | None,
        typer.Option(help="Event time of the positions: ISO 8601 with a time zone, or a number since 1970."),
    ] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(
            min=0,
            help="Accuracy of the positions, in units of the coordinates, or metres on the globe. Default: no error.",
        ),
    ] = None,
    only: Annotated[Only | None, typer.Option(help=ONLY)] = None,
    ttl: Annotated[str | None, typer.Option(help=TTL)] = None,
    as_json: AsJson = False,
) -> None:
    """Put keys into a keyed hull, in one batch: a new key is inserted, a known key moves.

        dynhull put vehicles LH400 -73.9 40.7

    The corners of the hull have names from then on: `dynhull query vehicles vertices --keys`. A missing hull is created
    by `dynhull create vehicles --keyed str`. Use `dynhull load --key` for files and for more than fits into one batch.
    """
    from .keyed_rows import keyed_rows, keys_for
    from .reading.times import TimeReader, as_times

    keys, points = keyed_rows(row)
    times = None if time is None else as_times([TimeReader("--time").read(time)] * len(keys))
    accuracies = None if accuracy is None else [accuracy] * len(keys)
    named, given = keys_for(client, name, keys), duration(ttl, "--ttl")
    applied = client.put(name, named, points, times, only=only, ttl=given, accuracies=accuracies)
    if applied.points == applied.inserted:  # the hull was empty, and can still be another one
        _remark_on_degrees(client, name, points)
    _report(
        name, applied, f"{plural(applied.inserted, 'key')} new, {applied.moved:,} moved{_left_out(applied)}", as_json
    )


@connected
def remove(
    client: "HullClient",
    name: HullName,
    points: Rows = None,
    key: Annotated[
        list[str] | None, typer.Option(help="Key to remove from a keyed hull, in place of points. May be repeated.")
    ] = None,
    missing_ok: Annotated[
        bool, typer.Option("--missing-ok", help="Skip points and keys that are not in the hull.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Remove points or keys from a hull, in one batch: all of them or none.

        dynhull remove fleet/north -73.9,40.7
        dynhull remove vehicles --key LH400 --key UA17

    Of a point that is there several times, one is removed for each time it is given.
    """
    from dynhull_client import KeyMissingError, PointMissingError

    missing: Literal["raise", "count"] = "count" if missing_ok else "raise"
    try:
        if key:
            if points:
                raise ValueError(f"give either points or --key: {points[0]!r} was given, too")
            from .keyed_rows import keys_for

            applied = client.remove(name, keys_for(client, name, key), missing=missing)
        else:
            applied = client.apply(name, delete=_all_rows(points), missing=missing)
    except (PointMissingError, KeyMissingError) as error:
        what = "key" if key else "point"
        which = f"a {what}" if error.row is None else f"{what} {error.row + 1}, {error.value},"
        fail(Exit.FAILED, f"{which} is not in the hull; nothing was removed. --missing-ok skips such {what}s")
    skipped = f", {applied.missing:,} not there" if applied.missing else ""
    removed = f"{plural(applied.deleted, 'key' if key else 'point')} removed{skipped}"
    _report(name, applied, removed + _left_out(applied), as_json)


def _all_rows(points: list[str] | None) -> "Points":
    import numpy as np

    from .rows import given_or_read, number_rows

    return np.concatenate(list(number_rows(given_or_read(points))))


def _remark_on_degrees(client: "HullClient", name: str, points: "Points") -> None:
    from .keyed_rows import known_hull
    from .reading.columns import look_like_degrees

    if not look_like_degrees(points):
        return
    info = known_hull(client, name)
    if info is not None and not info.geographic:
        typer.echo(
            f"{name} is a plane, and its points look like longitudes and latitudes: if they are, `dynhull create NAME "
            "--geographic` makes a hull for them, on the globe",
            err=True,
        )


def _left_out(applied: "Applied") -> str:
    """The rows that changed nothing, or were changed, by kind; empty if there are none."""
    return text_of({name: getattr(applied, name) for name in COUNTS if name not in OF_CHANGES})


def _report(name: str, applied: "Applied", what: str, as_json: bool) -> None:
    if as_json:
        typer.echo(json_line(name=name, **members(applied)))
    else:
        changed = "changed" if applied.hull_changed else "unchanged"
        typer.echo(f"{name}: {what}, {applied.points:,} in the hull, its shape {changed}")


# A point may begin with a minus sign.
for _command in (insert, put, remove):
    _command.context_settings = {"ignore_unknown_options": True}  # type: ignore[attr-defined]
