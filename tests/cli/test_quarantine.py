"""The quarantine on the command line."""

import json

import pytest
from command_line import dynhull, on_a_terminal

from dynhull_client import HullClient


def run(*arguments, code=0, **more):
    done = dynhull(*arguments, **more)
    assert done.exit_code == code, done.output
    return done


@pytest.mark.usefixtures("served")
def test_held_positions_are_listed_released_and_dropped(name):
    run("create", name, "--keyed", "str", "--max-speed", "10", "--confirmations", "0")
    run("put", name, "--time", "2026-03-01T12:00:00Z", input="a,0,0\nb,4,0\nc,0,4\n")
    put = run("put", name, "--time", "2026-03-01T12:00:02Z", input="a,100,0\nb,5,0\nc,0,-999\n").stdout
    assert put == f"{name}: 0 keys new, 1 moved, 2 held, 3 in the hull, its shape changed\n"
    listed = run("quarantine", "list", name).stdout
    assert listed.splitlines()[0] == "a\t100.0\t0.0\t2026-03-01T12:00:02+00:00\t50\t-\t2\t0"
    member = json.loads(run("quarantine", "list", name, "--json").stdout.splitlines()[1])
    assert (member["key"], member["breaks"], member["speed"], member["growth"]) == ("c", ["max_speed"], 501.5, None)
    released = run("quarantine", "release", name, "a", "b").stdout
    assert released == f"{name}: 1 key released, 1 not held, 3 in the hull\n"
    assert run("quarantine", "drop", name, "--all").stdout == f"{name}: 1 key dropped, 3 in the hull\n"
    assert run("quarantine", "list", name).stdout == ""

    rules = run("quarantine", "set", name, "--max-growth", "1.5", "--max-speed", "3").stdout
    assert rules == f"{name}: at most 3 a second and at most 1.5 times the area, 0 keys held, revision 5\n"
    listed = json.loads(run("list", name, "--json").stdout)
    assert run("list", name).stdout.endswith("\tquarantine at most 3 a second and at most 1.5 times the area, 0 held\n")
    assert (listed["max_speed"], listed["max_growth"], listed["confirmations"], listed["held"]) == (3, 1.5, 1, 0)
    assert "no rules" in run("quarantine", "set", name, "--off").stdout

    assert "--off for none" in run("quarantine", "set", name, code=2).stderr
    assert "--max-speed or --max-growth" in run("quarantine", "set", name, "--confirmations", "3", code=2).stderr
    assert "must be positive" in run("quarantine", "set", name, "--max-speed", "0", code=2).stderr
    assert "give either keys or --all" in run("quarantine", "drop", name, "a", "--all", code=2).stderr


def test_a_key_forges_no_lines_and_no_markup(name, served):
    """Devices choose keys: with tabs and ends of lines, commands for the terminal, what rich takes for markup."""
    run("create", name, "--keyed", "str", "--max-growth", "1", "--confirmations", "0")
    with HullClient(served) as client:
        client.put(name, ["a\tb\nc", "\x1b[2Jd", "[/e]"], [[0, 0], [4, 0], [0, 4]])
        client.put(name, ["f\n\x1b[2J[/f]"], [[9, 9]])
    run("fences", "create", name, "--circle", "0", "0", "9", "--subjects", name)
    keys = ["[/e]", "\\x1b[2Jd", "a\\tb\\nc"]
    inside = run("fences", "inside", name).stdout
    assert sorted(line.split("\t") for line in inside.splitlines()) == sorted([name, key] for key in keys)
    vertices = run("query", name, "vertices", "--keys").stdout
    assert sorted(line.split("\t")[2] for line in vertices.splitlines()) == sorted(keys)
    run("fences", "delete", name, "--yes")
    run("fences", "create", name, "--circle", "0", "0", "9", "--subjects", name, "--initial", "events")
    events = run("fences", "watch", name, "--after", "0", "--events", "3").stdout
    assert sorted(line.split("\t")[4] for line in events.splitlines()) == sorted(keys)
    assert run("quarantine", "list", name).stdout.startswith("f\\n\\x1b[2J[/f]\t9.0\t9.0\t")
    code, shown = on_a_terminal("quarantine", "list", name, "--address", served)
    assert (code, "f\\n\\x1b[2J[/f]" in shown) == (0, True), shown
