"""list, create, delete, insert, remove: hulls and points by hand; addresses as people write them; pipes that close."""

import json
import os
import subprocess

import pytest
from command_line import dynhull, on_a_terminal
from forked import COMMAND

from dynhull_client import HullClient


def names(prefix):
    return [line.split("\t")[0] for line in dynhull("list", prefix).stdout.splitlines()]


@pytest.mark.usefixtures("served")
def test_a_hull_from_create_to_delete(name):
    north, south = f"{name}/north", f"{name}/south"
    done = dynhull("create", north, south)
    assert (done.exit_code, done.stdout) == (0, f"{north}: created\n{south}: created\n")
    assert dynhull("create", north).exit_code == 1
    assert json.loads(dynhull("create", "--exist-ok", north, "--json").stdout) == {"name": north, "created": False}

    done = dynhull("insert", north, "1,2", "-3,4", "1,2")
    assert done.stdout == f"{north}: 3 points inserted, 3 in the hull, its shape changed\n"
    done = dynhull("insert", north, "--json", input="0 3.5\n\n-1,3\n")
    applied = {"inserted": 2, "deleted": 0, "missing": 0, "points": 5, "hull_changed": True}
    assert json.loads(done.stdout).items() >= {"name": north, "revision": 2, **applied}.items()
    done = dynhull("remove", north, "1,2", "-1,3")
    assert done.stdout == f"{north}: 2 points removed, 3 in the hull, its shape unchanged\n"
    assert dynhull("query", north).stdout == "-3.0\t4.0\n1.0\t2.0\n0.0\t3.5\n"

    assert dynhull("list", f"{name}/").stdout == f"{north}\t3\t3\t3\t-\t-\n{south}\t0\t0\t0\t-\t-\n"
    first = json.loads(dynhull("list", f"{name}/", "--json").stdout.splitlines()[0])
    assert (first["name"], first["points"], first["revision"]) == (north, 3, 3)

    done = dynhull("delete", north, south, "--yes")
    assert (done.exit_code, done.stdout) == (0, f"{north}: deleted, 3 points\n{south}: deleted, 0 points\n")
    assert names(name) == []
    assert dynhull("delete", north, "--yes").exit_code == 1
    assert dynhull("delete", north, "--yes", "--missing-ok").exit_code == 0


@pytest.mark.usefixtures("served")
def test_what_cannot_be_done_changes_nothing(name):
    dynhull("create", name)
    dynhull("insert", name, "1,2", "3,4")
    done = dynhull("remove", name, "1,2", "8,8")
    assert done.exit_code == 1
    assert done.stderr.startswith("error: point 2, (8.0, 8.0), is not in the hull; nothing was removed.")
    done = dynhull("insert", name, input="5 6\n\n1_000 7\n")
    assert (done.exit_code, done.stderr) == (2, "error: line 3: '1_000 7' is not X,Y with finite numbers\n")
    done = dynhull("insert", name, "1,2", "inf,2")
    assert (done.exit_code, done.stderr) == (2, "error: argument 2: 'inf,2' is not X,Y with finite numbers\n")
    assert dynhull("insert", name, input="").exit_code == 2
    few = f"few-{name}"
    dynhull("create", few, "--point-limit", "1")
    done = dynhull("insert", few, "1,2", "3,4")
    assert done.stderr.startswith("error: the limit on the points of the hull is 1 (--point-limit of the hull, or ")
    done = dynhull("delete", name, f"{name}-not-there", "--yes")
    assert done.exit_code == 1
    done = dynhull("delete", name)
    assert done.exit_code == 2
    assert f"add --yes to delete {name} (2 points)" in done.stderr
    assert dynhull("list", name).stdout == f"{name}\t2\t2\t1\t-\t-\n"


@pytest.mark.usefixtures("served")
def test_delete_asks_on_a_terminal(name):
    dynhull("create", name)
    code, shown = on_a_terminal("delete", name, answer=b"n\n")
    assert code == 1
    assert f"Delete {name} (0 points)? [y/N]" in shown
    assert "nothing was deleted" in shown
    assert names(name) == [name]
    assert on_a_terminal("delete", name, answer=b"y\n")[0] == 0
    assert names(name) == []


@pytest.mark.usefixtures("served")
def test_a_terminal_shows_a_table_and_is_not_read_from_unasked(name):
    dynhull("create", name)
    code, shown = on_a_terminal("list", name, answer=b"")
    assert code == 0
    assert "revision" in shown
    code, shown = on_a_terminal("insert", name, answer=b"")
    assert code == 2
    assert "or - to type them in" in shown
    code, shown = on_a_terminal("load", name, answer=b"")
    assert code == 2
    assert "give its name, or - to type the points in" in shown
    code, shown = on_a_terminal("load", name, "-", answer=b"1,2\n\x04")
    assert code == 0
    assert "1 point loaded" in shown


def test_addresses_as_people_write_them(served, name):
    host, port = served.split(":")
    dynhull("create", name)
    for address in (f"http://{served}", f"http://{served}/", f"grpc://{served}", f"dns:{served}", f"HTTP://{served}"):
        assert dynhull("list", name, "--address", address).stdout.startswith(name), address
    done = dynhull("list", "--address", f"https://{served}")
    assert done.exit_code == 3
    assert "does it serve TLS?" in done.stderr
    for address in ("ftp://a", f"{host}:", f"{host}:{port}0000", f"{host}:0", "a b", "", "http://a/b", "1:2:3"):
        done = dynhull("list", "--address", address)
        assert done.exit_code == 2, address
        assert f"address {address!r}" in done.stderr
        assert "Write HOST or HOST:PORT" in done.stderr


@pytest.mark.every(3)
@pytest.mark.parametrize(
    "command", ["--help", "load --help", "--version", "list", "query {name}", "watch {name} --json", "top --looks 99"]
)
def test_a_pipe_that_closes_early_is_success(served, name, command):
    with HullClient(served) as client:
        client.create_hull(name)
        client.apply(name, insert=[[x, x * x] for x in range(-4000, 4000)])
    # The reader is gone before the command writes.
    script = f"set -o pipefail; {COMMAND} {command.format(name=name)} | exec true"
    environment = {**os.environ, "DYNHULL_ADDRESS": served}
    done = subprocess.run(["bash", "-c", script], env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


@pytest.mark.one_process("several workers keep no shards in memory alone")
@pytest.mark.usefixtures("served")
def test_a_hull_over_shards(name):
    assert dynhull("create", name, "--shards", "3").stdout == f"{name}: created\n"
    assert json.loads(dynhull("list", name, "--json").stdout)["shards"] == 3
    assert dynhull("reshard", name, "1").stdout == f"{name}: 1 shard, revision 1\n"
    again = json.loads(dynhull("reshard", name, "5", "--json").stdout)
    assert again == {"name": name, "revision": 2, "shards": 5}
    refused = dynhull("reshard", name, "2000")
    assert "SHARDS is 2000: must be at most 1024" in refused.stderr
    refused = dynhull("create", f"{name}-2", "--shards", "2", "--geographic")
    assert (refused.exit_code, "is geographic, so it cannot be divided" in refused.stderr) == (1, True)
    refused = dynhull("create", f"{name}-2", "--shards", "2000")
    assert "Invalid value for '--shards'" in refused.stderr
