"""`dynhull alarms` as users run it."""

import json

import pytest
from command_line import dynhull

from dynhull_client import HullClient


@pytest.fixture
def hull(address: str, name: str) -> str:
    """A hull whose alarm of the same name was raised, with an area of 8."""
    with HullClient(address) as client:
        client.create_hull(name, keyed="str")
        client.create_alarm(name, hull=name, when="area > 7", clear="area < 6")
        client.put(name, ["a", "b", "c"], [(0, 0), (4, 0), (0, 4)])
    return name


def test_an_alarm_is_created_and_shown(address: str, name: str) -> None:
    rule = "--prefix", f"{name}/", "--when", "diameter>=2", "--for", "30s", "--max-event-age", "7d"
    made = dynhull("alarms", "create", name, *rule, "--address", address)
    assert made.stdout == f"{name}: diameter >= 2 for 30s, clear diameter < 2\n"
    shown = json.loads(dynhull("alarms", "show", name, "--json", "--address", address).stdout)
    assert (shown["prefix"], shown["hull"], shown["for"], shown["statuses"]) == (f"{name}/", None, 30.0, [])
    listed = dynhull("alarms", "list", name, "--address", address).stdout
    assert listed == f"{name}\t{name}/*\tdiameter >= 2 for 30s, clear diameter < 2\t0\t0\t0\n"
    assert dynhull("alarms", "delete", name, "--yes", "--address", address).stdout == f"{name}: deleted\n"
    again = dynhull("alarms", "show", name, "--address", address)
    assert again.exit_code == 1
    assert again.stderr.startswith(f"error: there is no alarm {name!r}\n`dynhull alarms list` shows")


def test_a_bad_condition_names_the_option(address: str, hull: str) -> None:
    more = "--hull", hull, "--address", address
    bad = dynhull("alarms", "create", f"{hull}/2", "--when", "area > much", *more)
    assert bad.stderr == "error: --when is 'area > much': at position 8: expected a number\n"
    wrong = dynhull("alarms", "create", f"{hull}/2", "--when", "area > 4", "--clear", "area < 5", *more)
    assert "--clear is 'area < 5': must be weaker than 'area > 4'" in wrong.stderr
    both = dynhull("alarms", "create", f"{hull}/2", "--when", "area > 4", "--prefix", "a", *more)
    assert "give one of --hull and --prefix" in both.stderr


def test_events_are_watched_and_acknowledged(address: str, hull: str) -> None:
    watch = "alarms", "watch", hull, "--consumer", "pager", "--ack", "--events", "1", "--address", address
    cells = dynhull(*watch).stdout.rstrip("\n").split("\t")
    assert [cells[0], *cells[2:]] == ["1", "raised", hull, "8.0", "7.0", "batch"]
    with HullClient(address) as client:
        client.put(hull, ["c"], [(0, 1)])
    event = json.loads(dynhull(*watch, "--json").stdout)
    assert (event["type"], event["value"], event["bound"], event["previous"]) == ("cleared", 2.0, 6.0, 8.0)


def test_somebody_takes_care_of_it(address: str, hull: str) -> None:
    acked = dynhull("alarms", "ack", hull, hull, "--address", address)
    assert acked.stdout == f"{hull}: acknowledged for {hull}\n"
    muted = dynhull("alarms", "mute", hull, hull, "2h", "--address", address)
    assert f"{hull}: muted for {hull} until " in muted.stdout
    shown = dynhull("alarms", "show", hull, "--address", address).stdout
    assert "raised\t1 of 1 hull\n" in shown
    assert f"hull\t{hull}\traised\t8.0\tsince " in shown
    assert "\tacknowledged " in shown
    assert "\tmuted until " in shown
    loud = dynhull("alarms", "mute", hull, hull, "0", "--address", address)
    assert loud.stdout == f"{hull}: not muted for {hull}\n"
