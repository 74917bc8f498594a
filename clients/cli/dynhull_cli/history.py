"""`dynhull history`: what there is of the past of a hull, and how much of it is kept."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from .connected import AsJson, HullName, connected
from .durations import duration, shown
from .groups import beside
from .json_lines import json_line
from .plural import plural

if TYPE_CHECKING:
    from datetime import timedelta

    from dynhull_client import Erasure, History, HullClient

FOREVER, NOTHING = "forever", "none"
KEPT = "How long to keep the past: a time span such as 30d, or forever."

HistoryBytes = Annotated[
    int | None,
    typer.Option("--history-bytes", help="Bytes in which the past is kept at most; the oldest goes first.", min=1),
]


@connected
def set_history(
    client: "HullClient",
    name: HullName,
    history: Annotated[str, typer.Argument(metavar="HISTORY", help=f"{KEPT} Or none.")],
    history_bytes: HistoryBytes = None,
    as_json: AsJson = False,
) -> None:
    """Change how much of its past a hull keeps. What is to be kept no longer is gone within a minute.

    dynhull history set fleet 30d
    """
    kept = given_history(history, "HISTORY")
    if kept is None and history_bytes is not None:
        raise ValueError("--history-bytes is given with a time span, or with forever")
    client.set_history(name, kept, history_bytes)
    _report(client, name, as_json)


@connected
def erase_history(
    client: "HullClient",
    name: HullName,
    key: Annotated[list[str], typer.Option(help="Key to erase. May be repeated.")],
    as_json: AsJson = False,
) -> None:
    """Erase keys from the past of a hull, which then is as if they had never been in it.

        dynhull remove fleet --key LH400
        dynhull history erase fleet --key LH400

    All of it is erased at once, or none. What the hull has now stays, so a key that it has is refused. Backups
    that were made before, and events of fences, keep the keys.
    """
    from .keyed_rows import keys_for

    found = client.erase_history(name, keys_for(client, name, key))
    if as_json:
        typer.echo(json_line(name=name, erased=None if found is None else _erasure(found)))
    elif found is None:
        typer.echo(f"{name}: no segment has {'this key' if len(key) == 1 else 'any of these keys'}")
    else:
        revisions = f"revisions {found.first_revision} to {found.last_revision}"
        typer.echo(f"{name}: {plural(found.moves, 'move')} of {plural(found.keys, 'key')} erased from {revisions}")


@beside({"set": set_history, "erase": erase_history})
@connected
def history(client: "HullClient", name: HullName, as_json: AsJson = False) -> None:
    """Show from when on the past of a hull can be read, and how many bytes it takes.

        dynhull create fleet --keyed str --history 30d
        dynhull history fleet --json | jq .bytes

    What the journal of the server drops becomes segments: files in Parquet, which other programs read, too. `dynhull
    history set` changes how much is kept.
    """
    _report(client, name, as_json)


def given_history(text: str | None, option: str) -> "timedelta | bool | None":
    """How long the past is kept, as the SDK takes it. ValueError names the option."""
    if text == FOREVER:
        return True
    return None if text == NOTHING else duration(text, option)


def _report(client: "HullClient", name: str, as_json: bool) -> None:
    found = client.history(name)
    if as_json:
        age = found.history
        typer.echo(
            json_line(
                name=name,
                first_revision=found.first_revision,
                first_time=None if found.first_time is None else found.first_time.isoformat(),
                last_revision=found.last_revision,
                last_time=None if found.last_time is None else found.last_time.isoformat(),
                bytes=found.bytes,
                batches=found.batches,
                moves=found.moves,
                history=age if age is None or isinstance(age, bool) else age.total_seconds(),
                history_bytes=found.history_bytes,
                erasures=list(map(_erasure, found.erasures)),
            )
        )
        return
    since = "" if found.first_time is None else f" of {found.first_time.isoformat(timespec='seconds')}"
    in_segments = f"{plural(found.moves, 'move')} in {plural(found.bytes, 'byte')} of segments"
    typer.echo(f"{name}: from revision {found.first_revision}{since} on, {in_segments}, {_kept(found)}")
    for each in found.erasures:
        revisions = f"revisions {each.first_revision} to {each.last_revision}"
        erased = f"{plural(each.keys, 'key')} erased from {revisions}, {plural(each.moves, 'move')}"
        typer.echo(f"  {each.time.isoformat(timespec='seconds')}: {erased}")


def _erasure(erasure: "Erasure") -> dict[str, Any]:
    return {
        "time": erasure.time.isoformat(),
        "first_revision": erasure.first_revision,
        "last_revision": erasure.last_revision,
        "keys": erasure.keys,
        "moves": erasure.moves,
    }


def _kept(found: "History") -> str:
    if found.history is None:
        return "no past is kept"
    age = "for ever" if isinstance(found.history, bool) else f"for {shown(found.history)}"
    return f"kept {age}" + ("" if found.history_bytes is None else f", {plural(found.history_bytes, 'byte')} at most")
