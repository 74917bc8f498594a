"""`dynhull track`: the ways of keys through the past of a hull."""

from typing import TYPE_CHECKING, Annotated

import typer

from .connected import AsJson, HullName, connected
from .durations import more_than_0
from .replay import From, To

if TYPE_CHECKING:
    from dynhull_client import HullClient


@connected
def track(
    client: "HullClient",
    name: HullName,
    keys: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[KEY]...", help="The keys. Default, or -: lines of standard input.", show_default=False
        ),
    ] = None,
    begin: From = None,
    end: To = None,
    every: Annotated[
        str | None,
        typer.Option(metavar="SPAN", help="Of each key the last place in each span alone, such as 1m; by default all."),
    ] = None,
    as_json: AsJson = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print CSV, with a heading.")] = False,
    as_geojson: Annotated[
        bool, typer.Option("--geojson", help="Print a GeoJSON FeatureCollection with a line for each key.")
    ] = False,
) -> None:
    """Show where keys were: a line per place, with the key, the time of the commit, x and y between tabs.

        dynhull track fleet LH400 --from 2026-11-24T06:00Z --to 2026-11-24T18:00Z
        dynhull track fleet LH400 UA17 --every 1m --geojson > ways.geojson

    The first place of a key is where it was at the start, if it was in the hull then. nan says that it left the hull.
    With --json and --csv there are also the revision and, if there is one, the time that was sent with the position.

    With --geojson, "times" of a feature has the time of each of its places; where the key was gone in between, it is a
    MultiLineString. Lines are not cut at the antimeridian.
    """
    if as_json + as_csv + as_geojson > 1:
        raise ValueError("give one of --json, --csv and --geojson")
    from dynhull_surface.as_of import moment_of

    from .keyed_rows import given_keys, keys_for
    from .tracks import csv_lines, feature_collection, json_lines, lines

    found = client.track(
        name,
        keys_for(client, name, given_keys(keys)),
        moment_of(begin, "--from"),
        moment_of(end, "--to"),
        every=None if every is None else more_than_0(every, "--every"),
    )
    if as_geojson:
        typer.echo(feature_collection(found))
        return
    shown = json_lines if as_json else csv_lines if as_csv else lines
    for line in shown(found):
        typer.echo(line)
