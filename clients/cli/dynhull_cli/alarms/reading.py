"""`dynhull alarms list`, `show` and `delete`."""

from typing import TYPE_CHECKING, Annotated

import typer

from ..completion import alarms
from ..connected import AsJson, connected
from ..json_lines import json_line
from ..listing import below, confirm_deletion, existing, listed, print_list
from ..plural import plural
from ..tab_lines import tab_line
from .settings import AlarmName

if TYPE_CHECKING:
    from rich.table import Table

    from dynhull_client import Alarm, HullClient


@connected
def list_alarms(
    client: "HullClient",
    prefix: Annotated[str, typer.Argument(metavar="PREFIX", help="List only alarms whose names begin with this.")] = "",
    as_json: AsJson = False,
) -> None:
    """List alarms by name, with their hulls, condition, the number of hulls they are raised for, and the last sequence.

        dynhull alarms list --json | jq -c 'select(.raised > 0)'

    A terminal shows a table; a pipe receives one line per alarm with tabs between the columns.
    """
    from .shown import alarm_members

    print_list(listed(client.list_alarms(prefix), below("alarms", prefix)), as_json, alarm_members, _line, _table)


@connected
def show(client: "HullClient", name: AlarmName, as_json: AsJson = False) -> None:
    """Show an alarm: its condition, counts and consumers, and the hulls for which it is raised, waits, or is muted.

    dynhull alarms show spread
    """
    from .shown import alarm_members, condition_text, hulls_text, status_cells

    alarm = client.get_alarm(name)
    if as_json:
        typer.echo(json_line(**alarm_members(alarm)))
        return
    typer.echo(f"hulls\t{hulls_text(alarm)}")
    typer.echo(f"condition\t{condition_text(alarm)}")
    typer.echo(f"raised\t{alarm.raised} of {plural(alarm.hulls, 'hull')}")
    kept = f"{alarm.first_sequence}-{alarm.last_sequence}" if alarm.first_sequence <= alarm.last_sequence else "none"
    typer.echo(f"events\t{kept} kept, last sequence {alarm.last_sequence}")
    for status in alarm.statuses:
        typer.echo(tab_line("hull", *status_cells(status)))
    for each in alarm.consumers:
        lost = f", {plural(each.lost, 'event')} lost" if each.lost else ""
        typer.echo(
            f"consumer\t{each.name}: acknowledged {each.acknowledged}, {plural(each.backlog, 'event')} to come{lost}"
        )


@connected
def delete(
    client: "HullClient",
    names: Annotated[list[str], typer.Argument(metavar="ALARM", help="Names of the alarms.", autocompletion=alarms)],
    yes: Annotated[bool, typer.Option("--yes", "-y", help="Delete without asking.")] = False,
    missing_ok: Annotated[bool, typer.Option("--missing-ok", help="Skip an alarm that does not exist.")] = False,
    as_json: AsJson = False,
) -> None:
    """Delete alarms with their events and consumers. This cannot be undone; hulls and points stay.

        dynhull alarms delete spread

    On a terminal the command asks first; elsewhere it needs --yes. Where an alarm does not exist, none is deleted.
    """
    from dynhull_client import AlarmNotFoundError

    found = existing(names, client.get_alarm, AlarmNotFoundError if missing_ok else None)
    if not yes:
        confirm_deletion([f"{alarm.name} (last event {alarm.last_sequence})" for alarm in found])
    for alarm in found:
        client.delete_alarm(alarm.name)
        typer.echo(json_line(name=alarm.name, deleted=True) if as_json else f"{alarm.name}: deleted")


def _line(alarm: "Alarm") -> str:
    from .shown import condition_text, hulls_text

    return tab_line(
        alarm.name,
        hulls_text(alarm),
        condition_text(alarm),
        str(alarm.raised),
        str(alarm.hulls),
        str(alarm.last_sequence),
    )


def _table(alarms: "list[Alarm]") -> "Table":
    from rich.table import Table

    from .shown import condition_text, hulls_text

    table = Table("alarm", "hulls", "condition")
    for heading in ("raised", "of", "last event"):
        table.add_column(heading, justify="right")
    for alarm in alarms:
        counts = (f"{each:,}" for each in (alarm.raised, alarm.hulls, alarm.last_sequence))
        table.add_row(alarm.name, hulls_text(alarm), condition_text(alarm), *counts)
    return table
