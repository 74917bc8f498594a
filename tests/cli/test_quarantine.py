"""The quarantine on the command line."""

import json

import pytest
from command_line import dynhull


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
