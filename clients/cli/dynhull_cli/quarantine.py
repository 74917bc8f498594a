"""`dynhull quarantine`: the rules that hold bad positions out of a keyed hull, and the positions held."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from .connected import AsJson, HullName, connected
from .groups import group
from .json_lines import json_line, members
from .listing import listed, print_list
from .plural import plural
from .tab_lines import printable, tab_line

if TYPE_CHECKING:
    from rich.table import Table

    from dynhull_client import Applied, HeldPosition, HullClient, Quarantine

SPEED = "Hold out a key that is faster, in units of the coordinates a second, or metres a second on the globe."
GROWTH = "Hold out a position that would enlarge the area of the hull by more than this factor, at least 1."
CONFIRMATIONS = "Later, consistent positions that let a key in; 0 for none: only by hand. Default: 1."

MaxSpeed = Annotated[float | None, typer.Option("--max-speed", help=SPEED)]
MaxGrowth = Annotated[float | None, typer.Option("--max-growth", help=GROWTH)]
Confirmations = Annotated[int | None, typer.Option("--confirmations", help=CONFIRMATIONS, min=0, max=1000)]
Keys = Annotated[
    list[str] | None,
    typer.Argument(metavar="KEY", help="The keys. Default, or -: lines of standard input.", show_default=False),
]
All = Annotated[bool, typer.Option("--all", help="All keys in quarantine.")]


@connected
def list_held(client: "HullClient", name: HullName, as_json: AsJson = False) -> None:
    """List the positions in quarantine by key, with their time, speed, growth and the revision that held them.

        dynhull quarantine list vehicles --json | jq -r .key

    A terminal shows a table; a pipe receives one line per key with tabs between the columns, and - for a rule that is
    not broken.
    """
    held = listed(client.list_held(name), f"{name} has no keys in quarantine")
    print_list(held, as_json, _members, lambda each: tab_line(*_columns(each)), _table)


@connected
def release(
    client: "HullClient", name: HullName, keys: Keys = None, every: All = False, as_json: AsJson = False
) -> None:
    """Let held positions in, whatever the rules say.

    dynhull quarantine release vehicles LH400
    """
    applied = client.release(name, _chosen(client, name, keys, every))
    _report(name, applied, f"{plural(applied.released, 'key')} released", as_json)


@connected
def drop(client: "HullClient", name: HullName, keys: Keys = None, every: All = False, as_json: AsJson = False) -> None:
    """Drop held positions. The keys stay where they were.

    dynhull quarantine drop vehicles --all
    """
    applied = client.drop(name, _chosen(client, name, keys, every))
    _report(name, applied, f"{plural(applied.dropped, 'key')} dropped", as_json)


@connected
def set_rules(
    client: "HullClient",
    name: HullName,
    max_speed: MaxSpeed = None,
    max_growth: MaxGrowth = None,
    confirmations: Confirmations = None,
    off: Annotated[bool, typer.Option("--off", help="Have no rules.")] = False,
    as_json: AsJson = False,
) -> None:
    """Replace the rules of a keyed hull: those that are not given are off. What is held stays so.

    dynhull quarantine set vehicles --max-speed 350
    """
    rules = given_rules(max_speed, max_growth, confirmations)
    if off == (rules is not None):
        raise ValueError("give rules, --max-speed or --max-growth, or --off for none")
    info = client.set_quarantine(name, rules)
    if as_json:
        typer.echo(json_line(name=name, revision=info.revision, held=info.held, **rule_members(info.quarantine)))
    else:
        typer.echo(f"{name}: {shown_rules(info.quarantine)}, {plural(info.held, 'key')} held, revision {info.revision}")


@group(list=list_held, release=release, drop=drop, set=set_rules)
def quarantine() -> None:
    """Hold bad positions out of a keyed hull: list them, let them in, drop them, change the rules.

        dynhull create vehicles --keyed str --max-speed 350
        dynhull quarantine list vehicles

    A position that breaks a rule waits in quarantine: neither the hull nor its watches and fences see it, until later
    positions of its key confirm or contradict it, or somebody releases or drops it.
    """


def given_rules(max_speed: float | None, max_growth: float | None, confirmations: int | None) -> "Quarantine | None":
    """The rules that the options give; None without a rule, ValueError for confirmations alone."""
    from dynhull_client import Quarantine

    if max_speed is None and max_growth is None:
        if confirmations is not None:
            raise ValueError("--confirmations is given with --max-speed or --max-growth")
        return None
    return Quarantine(max_speed, max_growth, 1 if confirmations is None else confirmations)


def rule_members(rules: "Quarantine | None") -> dict[str, Any]:
    """The rules as members of a JSON object; null for those that are off."""
    return {"max_speed": None, "max_growth": None, "confirmations": None} if rules is None else members(rules)


def shown_rules(rules: "Quarantine | None") -> str:
    """The rules in a few words."""
    if rules is None or (rules.max_speed is None and rules.max_growth is None):
        return "no rules"
    speed = [] if rules.max_speed is None else [f"at most {rules.max_speed:g} a second"]
    growth = [] if rules.max_growth is None else [f"at most {rules.max_growth:g} times the area"]
    return " and ".join([*speed, *growth])


def _chosen(client: "HullClient", name: str, keys: list[str] | None, every: bool) -> list[Any]:
    from .keyed_rows import given_keys, keys_for

    if every and keys:
        raise ValueError(f"give either keys or --all: {keys[0]!r} was given, too")
    if every:
        return [each.key for each in client.list_held(name)]
    return keys_for(client, name, given_keys(keys))


def _report(name: str, applied: "Applied", what: str, as_json: bool) -> None:
    if as_json:
        counts = {"released": applied.released, "dropped": applied.dropped, "missing": applied.missing}
        typer.echo(json_line(name=name, revision=applied.revision, points=applied.points, **counts))
        return
    missing = f", {applied.missing:,} not held" if applied.missing else ""
    typer.echo(f"{name}: {what}{missing}, {applied.points:,} in the hull")


def _members(held: "HeldPosition") -> dict[str, Any]:
    return members(held) | {"breaks": held.breaks}


def _columns(held: "HeldPosition") -> list[str]:
    time = "-" if held.time is None else held.time.isoformat()
    broken = ("-" if value is None else f"{value:g}" for value in (held.speed, held.growth))
    return [str(held.key), *map(str, held.position), time, *broken, str(held.revision), str(held.confirmations)]


def _table(held: "list[HeldPosition]") -> "Table":
    from rich.table import Table

    table = Table("key", "x", "y", "time", "speed", "growth", "revision", "confirmed")
    for each in held:
        table.add_row(*map(printable, _columns(each)))
    return table
