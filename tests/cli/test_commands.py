"""The reading commands: query, watch, verify, top, bench. Their output, for people and pipes, and their exit codes."""

import hashlib
import json
import os
import re
import subprocess
from pathlib import Path

import pytest
import trustme
from cases import slow
from command_line import dynhull, on_a_terminal
from forgetful import FORGETFUL
from forked import COMMAND, Process
from server_process import PATIENCE, run, server_process

from dynhull_client import HullClient

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4], [1, 1], [1, 1]]


@pytest.fixture
def hull(served, name):
    with HullClient(served) as client:
        client.create_hull(name)
        client.apply(name, insert=SQUARE)
    return name


@pytest.mark.parametrize(
    ("question", "points", "answers"),
    [
        ("locate", ["1,1", "4,2", "-1,2"], ["inside", "boundary", "outside"]),
        ("count", ["1,1", "4,2"], ["2", "0"]),
        ("distance", ["1,1", "7,8"], ["0.0", "5.0"]),
        ("support", ["1,0", "-1,1"], ["4.0\t0.0", "0.0\t4.0"]),
        ("tangents", ["8,2", "1,1"], ["4.0\t0.0\t4.0\t4.0", "nan\tnan\tnan\tnan"]),
        ("lines", ["-1,2,9,2"], ["0.0\t2.0\t4.0\t2.0"]),
    ],
)
def test_query(hull, question, points, answers):
    done = dynhull("query", hull, question, *points)
    assert done.exit_code == 0, done.stderr
    lines = done.stdout.splitlines()
    columns = points[0].count(",") + 1
    assert [line.split("\t", columns)[columns] for line in lines] == answers
    assert [line.split("\t")[0] for line in lines] == [str(float(each.split(",")[0])) for each in points]
    assert dynhull("query", hull, question, input="\n".join(points).replace(",", " ")).stdout == done.stdout


def test_query_for_pipes(hull):
    done = dynhull("query", hull, "tangents", "--json", "8,2", "1,1")
    assert [json.loads(line) for line in done.stdout.splitlines()] == [
        {"asked": [8, 2], "answer": [[4, 0], [4, 4]]},
        {"asked": [1, 1], "answer": [[None, None], [None, None]]},
    ]
    done = dynhull("query", hull)
    assert done.stdout == "0.0\t0.0\n4.0\t0.0\n4.0\t4.0\n0.0\t4.0\n"


@pytest.mark.parametrize("text", ["abc", "1", "1,2,3", "1,nan", "--jsn"])
def test_what_is_no_point(hull, text):
    done = dynhull("query", hull, "locate", "1,1", text)
    assert done.exit_code == 2
    assert text in done.stderr


def test_vertices_are_asked_for_without_points(hull):
    done = dynhull("query", hull, "vertices", "1,2")
    assert (done.exit_code, done.stderr) == (2, "error: vertices takes no points, but '1,2' was given\n")


def test_layers_and_influence(hull):
    lines = dynhull("query", hull, "layers").stdout.splitlines()
    assert lines == ["1\t0.0\t0.0", "1\t4.0\t0.0", "1\t4.0\t4.0", "1\t0.0\t4.0", "2\t1.0\t1.0"]
    assert len(dynhull("query", hull, "layers", "--layer", 1).stdout.splitlines()) == 4
    assert dynhull("query", hull, "influence").stdout.splitlines()[0] == "4.0\t0.0\t8.0"
    assert json.loads(dynhull("query", hull, "layers", "--json").stdout.splitlines()[-1]) == {
        "layer": 2,
        "vertex": [1, 1],
    }
    assert (
        dynhull("query", hull, "locate", "--layer", 2, "1,1", "2,2").stdout == "1.0\t1.0\tboundary\n2.0\t2.0\toutside\n"
    )
    done = dynhull("query", hull, "count", "--layer", 2, "1,1")
    assert (done.exit_code, done.stderr) == (2, "error: count is not about a layer, but --layer was given\n")
    assert dynhull("query", hull, "influence", "--keys").exit_code == 2


def test_watch_of_a_layer_and_of_few_vertices(hull):
    done = dynhull("watch", hull, "--events", 1, "--layer", 2, "--json")
    assert json.loads(done.stdout)["added"] == [[1, 1]]
    done = dynhull("watch", hull, "--events", 1, "--max-vertices", 2)
    assert done.stdout == "1\t6\t2\t16.0\t16.0\t2.8284271247461903\n"
    event = json.loads(dynhull("watch", hull, "--events", 1, "--max-vertices", 4, "--layer", 1, "--json").stdout)
    assert (event["vertices"], event["error"]) == ([[0, 0], [4, 0], [4, 4], [0, 4]], 0)


def test_watch(hull):
    done = dynhull("watch", hull, "--events", 1)
    assert (done.exit_code, done.stdout) == (0, "1\t6\t4\t4\t0\t16.0\t16.0\n")
    done = dynhull("watch", hull, "--events", 1, "--json")
    event = json.loads(done.stdout)
    assert (event["revision"], event["points"], event["snapshot"]) == (1, 6, True)
    assert (event["added"], event["removed"]) == ([[0, 0], [4, 0], [4, 4], [0, 4]], [])
    assert (event["area"], event["bounds"]) == (16, [0, 0, 4, 4])


def test_watch_of_many(hull, served):
    done = dynhull("watch", "--prefix", hull, "--events", 1)
    assert (done.exit_code, done.stdout) == (0, f"state\t{hull}\t1\t6\t4\t16.0\t16.0\n")
    done = dynhull("watch", "--prefix", hull, "--events", 2, "--json", "--outlines")
    state, complete = map(json.loads, done.stdout.splitlines())
    assert (state["kind"], state["hull"], state["revision"], state["points"]) == ("state", hull, 1, 6)
    assert (state["vertices"], state["measures"]["area"]) == ([[0, 0], [4, 0], [4, 4], [0, 4]], 16)
    assert complete["kind"] == "complete"
    with HullClient(served) as client:
        client.create_hull(f"{hull}/new")
    done = dynhull("watch", "--prefix", hull, "--events", 3, "--json", "--position", complete["position"])
    assert {"state", "complete"} <= {json.loads(line)["kind"] for line in done.stdout.splitlines()}


@pytest.mark.parametrize(
    "arguments",
    [
        (),
        ("a", "--prefix", "a"),
        ("a", "--outlines"),
        ("--prefix", "a", "--keys"),
        ("--prefix", "a", "--position", "x"),
    ],
)
def test_watches_that_make_no_sense(arguments):
    assert dynhull("watch", *arguments).exit_code == 2


def test_watch_tells_each_change_at_once(hull, served):
    command = [COMMAND, "watch", hull, "--json", "--max-rate", "0", "--events", "3"]
    with HullClient(served) as client, Process(command, stdout=subprocess.PIPE, text=True) as watching:
        assert json.loads(watching.stdout.readline())["snapshot"]
        client.apply(hull, insert=[[9, 9]])
        event = json.loads(watching.stdout.readline())
        assert (event["revision"], event["added"], event["removed"]) == (2, [[9, 9]], [[4, 4]])
        client.apply(hull, delete=[[9, 9]])
        event = json.loads(watching.stdout.readline())
        assert (event["revision"], event["added"], event["removed"]) == (3, [[4, 4]], [[9, 9]])
        assert watching.wait(PATIENCE) == 0


def test_verify(hull, name):
    done = dynhull("verify", hull)
    assert done.exit_code == 0
    assert done.stdout.startswith(f"{hull}: verified at revision 1: 6 points, 4 vertices (Chan's guesses: ")
    done = dynhull("verify", hull, f"{name}-not-there")
    assert done.exit_code == 1
    assert done.stderr.startswith(f"error: there is no hull '{name}-not-there'\n")


@pytest.mark.one_process("faults are put into the process that is started")
def test_verify_of_a_wrong_hull():
    with server_process("--scrub-cpu", "0", wrap=FORGETFUL) as server, HullClient(server.address) as client:
        client.create_hull("a")
        client.apply("a", insert=SQUARE)
        done = dynhull("verify", "--address", server.address)
        assert done.exit_code == 1
        assert done.stdout.startswith("a: DIFFERENT at revision 1: ")
        found = json.loads(dynhull("verify", "a", "--address", server.address, "--json").stdout)
    assert (found["name"], found["equal"], found["points"]) == ("a", False, 6)
    assert found["difference"] == {"row": 0, "live": [4, 0], "recomputed": [0, 0]}


def test_measure(hull):
    done = dynhull("measure", hull)
    assert done.exit_code == 0, done.stderr
    lines = dict(line.split("\t", 1) for line in done.stdout.splitlines())
    assert (lines["area"], lines["width"], lines["bounds"]) == ("16.0", "4.0", "0.0\t0.0\t4.0\t4.0")
    assert lines["min_circle"].startswith("2.0\t2.0\t2.828")
    told = json.loads(dynhull("measure", hull, "--json").stdout)
    assert (told["min_circle"], told["label_point"]) == ([[2, 2], 8**0.5], [2, 2])
    assert told.keys() == lines.keys()


def test_measure_on_the_globe(name, served):
    with HullClient(served) as client:
        client.create_hull(name, geographic=True)
        client.apply(name, insert=[(179, 0), (-179, 0), (180, 2)])
    lines = dynhull("measure", name).stdout.splitlines()
    assert lines[2:4] == ["bounds\t179.0\t0.0\t-179.0\t2.0\tdeg", lines[3]]
    assert [line.split("\t")[0] for line in lines] == [
        *("area", "perimeter", "bounds", "diameter", "revision", "label_point", "geographic")
    ]
    assert [lines[number].split("\t")[-1] for number in (0, 1, 3, 5)] == ["m2", "m", "m", "deg"]
    code, shown = on_a_terminal("measure", name, "--address", served)
    assert (code, "globe" in shown, " km2 " in shown, "│ 179 0 -179 2 deg" in shown) == (0, True, True, True)
    assert "nan" not in shown


def test_separate(hull, served):
    with HullClient(served) as client:
        client.create_hull(f"{hull}-other")
        client.apply(f"{hull}-other", insert=[[7, 2], [9, 1], [9, 3]])
    done = dynhull("separate", hull, f"{hull}-other")
    assert done.exit_code == 0, done.stderr
    lines = dict(line.split("\t", 1) for line in done.stdout.splitlines())
    assert (lines["intersect"], lines["distance"], lines["normal"]) == ("False", "3.0", "1.0\t0.0")
    told = json.loads(dynhull("separate", hull, f"{hull}-other", "--json").stdout)
    assert (told["intersect"], told["offset"], told["closest"]) == (False, 5.5, [[4, 2], [7, 2]])
    assert told.keys() == lines.keys()
    done = dynhull("separate", hull, f"{hull}-no")
    assert done.exit_code == 1
    assert done.stderr.startswith(f"error: there is no hull '{hull}-no'\n")


def test_phases(served, name):
    with HullClient(served) as client:
        client.create_hull(name)
        client.apply(name, insert=[[0, 0], [0.5, -1], [0.75, 0], [1, 0]])
    assert dynhull("phases", name).stdout == "0.0\t0.0\n0.5\t-1.0\n1.0\t0.0\n"
    assert json.loads(dynhull("phases", name, "--json").stdout.splitlines()[1]) == {"stable": [0.5, -1]}
    done = dynhull("phases", name, "0.75,0", "0.5,-2")
    numbers = [[0.75, 0, 0.5, 0.5, -1, 1, 0, 0.5, 0.5], [0.5, -2, -1, 0.5, -1, 0.5, -1, 1, 0]]
    assert [[float(each) for each in line.split("\t")] for line in done.stdout.splitlines()] == numbers
    assert dynhull("phases", name, "-", input="0.75 0\n0.5 -2\n").stdout == done.stdout
    assert json.loads(dynhull("phases", name, "0.75,0", "--json").stdout) == {
        "asked": [0.75, 0],
        "energy_above_hull": 0.5,
        "phases": [[0.5, -1], [1, 0]],
        "shares": [0.5, 0.5],
    }
    done = dynhull("phases", name, "2,0")
    assert (done.exit_code, done.stderr) == (2, "error: entries[0] is (2.0, 0.0): a composition is from 0 to 1\n")


def test_frontier(served, name):
    with HullClient(served) as client:
        client.create_hull(name)
        client.apply(name, insert=[[1, 2], [2, 5], [4, 6], [3, 3]])
    assert dynhull("frontier", name).stdout == "1.0\t2.0\t-1.0\n2.0\t5.0\t4.0\n4.0\t6.0\tnan\n"
    lines = dynhull("frontier", name, "--json").stdout.splitlines()
    assert json.loads(lines[2]) == {"efficient": [4, 6], "turning_rate": None}
    done = dynhull("frontier", name, "3,3", "2,5", "--rate", -2, "--rate", 0.5)
    assert done.stdout.splitlines() == [
        "3.0\t3.0\tdominated",
        "2.0\t5.0\tnot dominated",
        "-2.0\t1.0\t2.0\t4.0",
        "0.5\t2.0\t5.0\t2.25",
    ]
    lines = dynhull("frontier", name, "3,3", "--rate", 0.5, "--json").stdout.splitlines()
    assert [json.loads(line) for line in lines] == [
        {"asked": [3, 3], "dominated": True},
        {"rate": 0.5, "tangency": [2, 5], "sharpe_ratio": 2.25},
    ]


def test_top(hull, served):
    with HullClient(served) as client:
        client.create_hull(f"{hull}/other")
        client.apply(f"{hull}/other", insert=SQUARE * 2)
    done = dynhull("top", hull, "--interval", 0.05, "--json", "--looks", 2)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert [(row["name"], row["points"], row["distinct"]) for row in rows] == 2 * [
        (f"{hull}/other", 12, 5),
        (hull, 6, 5),
    ]
    done = dynhull("top", hull, "--interval", 0.05)
    assert done.stdout.splitlines()[1] == f"{hull}\t1\t6\t5\t0.0\t0.0"


def test_watch_and_top_on_a_terminal_show_tables(served):
    with HullClient(served) as client:
        client.create_hull("shown")
        client.apply("shown", insert=SQUARE)
    code, shown = on_a_terminal("watch", "shown", "--events", "1", "--address", served)
    assert code == 0
    assert "shown at revision 1" in shown
    assert cells(shown)[-1] == ["1", "6", "4", "+4 -0", "16", "16"]
    code, shown = on_a_terminal("top", "shown", "--interval", "0.01", "--looks", "2", "--address", served)
    assert code == 0
    assert cells(shown)[-1] == ["shown", "1", "6", "5", "0.0", "+0"]


def cells(shown):
    """The rows of the tables on a terminal."""
    return [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown.splitlines() if "│" in line]


def test_a_list_without_rows_says_so(served, name, tmp_path):
    """On standard error, as JSON too: an empty output might be a failure."""
    with HullClient(served) as client:
        client.create_hull(name, keyed="str")
        client.create_fence(name, area=[[0, 0], [1, 0], [0, 1]], subjects=name)
    lists = {
        "list nobody/": "no hulls with names that begin with 'nobody/'",
        "fences list nobody/": "no fences with names that begin with 'nobody/'",
        "top nobody/ --interval 0.01": "no hulls with names that begin with 'nobody/'",
        f"fences inside {name}": f"nobody is inside {name}",
        f"query {name} vertices": f"{name} has no vertices",
        f"query {name} influence": f"{name} has no vertices",
        f"query {name} vertices --layer 2": f"layer 2 of {name} has no vertices",
        f"phases {name}": f"{name} has no stable entries",
        f"frontier {name}": f"{name} has no efficient points",
        f"relay dead-letters list --state {tmp_path}": f"{tmp_path} has no dead letters",
    }
    for command, words in lists.items():
        for json_too in ([], ["--json"]) if "inside" not in command else ([],):
            done = dynhull(*command.split(), *json_too, input="")
            assert (done.exit_code, done.stdout, done.stderr) == (0, "", f"{words}\n"), command
    for question, words in {
        "locate": "no points: give X,Y",
        "lines": "no points: give X,Y,X,Y",
        "positions": "no keys",
    }.items():
        done = dynhull("query", name, question, input="")
        assert (done.exit_code, done.stderr.startswith(f"error: {words}")) == (2, True), done.stderr
    code, shown = on_a_terminal("list", "nobody/")
    assert (code, shown) == (0, "no hulls with names that begin with 'nobody/'\r\n")


def test_bench(served):
    done = dynhull("bench", "--seconds", 0.2, "--points", 1000, "--json")
    assert done.exit_code == 0, done.stderr
    figures = json.loads(done.stdout)
    assert figures["updates_per_second"] > 0
    assert 0 < figures["locate_ms_median"] <= figures["locate_ms_p99"]
    done = dynhull("bench", "--seconds", 0.1, "--points", 10)
    rate, acknowledgement, locate = done.stdout.splitlines()
    assert re.fullmatch(r"[\d,]+ updates per second", rate)
    for what, line in (("acknowledgement", acknowledgement), ("locate", locate)):
        assert re.fullmatch(what + r": median [\d.]+ ms, 99th percentile [\d.]+ ms", line)
    with HullClient(served) as client:
        assert list(client.list_hulls("bench-")) == []


COMMANDS = [
    ("load", "a", "-"),
    ("query", "a"),
    ("watch", "a"),
    ("verify", "a"),
    ("measure", "a"),
    ("separate", "a", "b"),
    ("phases", "a"),
    ("frontier", "a"),
    ("top",),
    ("bench",),
]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_a_wrong_address(command):
    done = dynhull(*command, "--address", "127.0.0.1:1", input="x,y\n1,2\n")
    assert done.exit_code == 3
    assert done.stderr.startswith("error: no answer from 127.0.0.1:1: ")
    assert "Is it running (dynhull serve)" in done.stderr
    assert done.stdout == ""


def test_tokens(tmp_path, monkeypatch):
    tokens = tmp_path / "tokens.toml"
    entry = {"name": '"t"', "sha256": f'"{hashlib.sha256(b"right").hexdigest()}"', "read": '["a"]', "write": '["a"]'}
    tokens.write_text("[[token]]\n" + "".join(f"{key} = {value}\n" for key, value in entry.items()))
    with server_process("--tokens", str(tokens), complaints="UNAUTHENTICATED") as server:
        monkeypatch.setenv("DYNHULL_ADDRESS", server.address)
        for token, words in (([], "requires a token: "), (["--token", "wrong"], "does not know the given token: ")):
            done = dynhull("load", "a", *token, input="x,y\n1,2\n")
            assert done.exit_code == 4
            assert words in done.stderr
            assert "with --token or in DYNHULL_TOKEN" in done.stderr
        monkeypatch.setenv("DYNHULL_TOKEN", "right")
        assert dynhull("load", "a", input="x,y\n1,2\n").exit_code == 0
        done = dynhull("load", "b", input="x,y\n1,2\n")
        assert done.exit_code == 4
        assert done.stderr.startswith("error: ")


def test_tls(tmp_path):
    authority = trustme.CA()
    issued = authority.issue_cert("127.0.0.1")
    names = {"ca": authority.cert_pem, "key": issued.private_key_pem, "cert": issued.cert_chain_pems[0]}
    for name, pem in names.items():
        pem.write_to_path(tmp_path / name)
    with server_process("--tls-cert", str(tmp_path / "cert"), "--tls-key", str(tmp_path / "key")) as server:
        where = ["--address", server.address]
        assert dynhull("top", *where, "--tls-ca", tmp_path / "ca").exit_code == 0
        assert dynhull("top", *where).exit_code == 3
        untrusted = dynhull("top", *where, "--tls")
        assert untrusted.exit_code == 3
        assert "name its authority's file with --tls-ca" in untrusted.stderr
        assert dynhull("top", "--address", f"https://{server.address}", "--tls-ca", tmp_path / "ca").exit_code == 0
        # gRPC reads the certificates that the machine trusts once in a process.
        trusting = {**os.environ, "GRPC_DEFAULT_SSL_ROOTS_FILE_PATH": str(tmp_path / "ca")}
        assert subprocess.run([COMMAND, "list", *where, "--tls"], env=trusting, check=False).returncode == 0
        pair = ["--client-cert", tmp_path / "cert", "--client-key", tmp_path / "key"]
        assert dynhull("top", *where, "--tls-ca", tmp_path / "ca", *pair).exit_code == 0
        done = dynhull("top", *where, "--client-key", tmp_path / "key")
        assert (done.exit_code, done.stderr) == (2, "error: --client-cert and --client-key must be given together\n")


def test_a_reader_that_has_enough(hull, served):
    with HullClient(served) as client:
        client.apply(hull, insert=[[x, x * x] for x in range(-4000, 4000)])
    command = f"{COMMAND} query {hull} --address {served} | head -1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert (done.stdout.count("\n"), done.stderr) == (1, "")


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="Linux only")
def test_a_full_disk_behind_standard_output(hull, served):
    command = f"{COMMAND} query {hull} --address {served} > /dev/full"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (2, "error: standard output: No space left on device\n")


@slow
def test_what_the_encoding_lacks_is_escaped(hull, served):
    with HullClient(served) as client:
        client.create_hull(f"{hull}/towns", keyed="str")
        client.put(f"{hull}/towns", ["Kiel", "Łódź", "Oslo"], [(0, 0), (4, 4), (0, 4)])
    command = [COMMAND, "query", f"{hull}/towns", "vertices", "--keys", "--address", served]
    done = subprocess.run(
        command, env=os.environ | {"PYTHONIOENCODING": "cp1252"}, capture_output=True, text=True, encoding="cp1252"
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert [line.split("\t")[2] for line in done.stdout.splitlines()] == ["Kiel", "\\u0141ód\\u017a", "Oslo"]


@slow
def test_a_reader_of_a_quiet_hull_that_has_enough(hull, served):
    for options in ("", "--json"):
        command = f"{COMMAND} watch {hull} {options} --address {served} | head -1"
        done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=PATIENCE, check=False)
        assert (done.stdout.count("\n"), done.stderr) == (1, "")


def test_columns_are_named():
    for command, names in (
        ("watch", "revision, points, vertices, vertices added, vertices removed, area, perimeter"),
        ("top", "name, revision, points, distinct points, batches per second, and points gained per second"),
    ):
        assert names in " ".join(dynhull(command, "--help").stdout.split())


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ("--tls-ca points.csv", "--tls-ca points.csv: the file has no certificates in PEM format"),
        ("--client-cert key --client-key cert", "not a certificate and its private key in PEM format"),
        ("--token a\nb", "token must consist of printable ASCII characters"),
    ],
)
def test_what_gRPC_would_not_explain(tmp_path, monkeypatch, options, words):  # noqa: N802
    issued = trustme.CA().issue_cert("127.0.0.1")
    issued.private_key_pem.write_to_path(tmp_path / "key")
    issued.cert_chain_pems[0].write_to_path(tmp_path / "cert")
    (tmp_path / "points.csv").write_text("x,y\n1,2\n")
    monkeypatch.chdir(tmp_path)
    done = run("list", "--address", "127.0.0.1:1", *options.split(" "))
    assert done.returncode == 2
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "offered"),
    [
        ("measure {name}/v", ["{name}/vans"]),
        ("delete {name}/", ["{name}/trucks", "{name}/vans"]),
        ("measure --address {address} {name}/t", ["{name}/trucks"]),
        ("fences show {name}", ["{name}/depot"]),
        ("create {name}/", []),
        ("measure --address 127.0.0.1:1 {name}", []),
        ("measure --address :: {name}", []),
    ],
)
def test_completion_knows_the_names_on_the_server(served, name, words, offered):
    for hull in ("vans", "trucks"):
        assert dynhull("create", f"{name}/{hull}", "--keyed", "str").exit_code == 0
    fenced = dynhull("fences", "create", f"{name}/depot", "--circle", 0, 0, 1, "--subjects", f"{name}/vans")
    assert fenced.exit_code == 0
    words = ["dynhull", *words.format(name=name, address=served).split()]
    completing = {"COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
    done = dynhull(prog_name="dynhull", env={"_DYNHULL_COMPLETE": "complete_bash", **completing})
    assert (done.stdout.split(), done.stderr) == ([each.format(name=name) for each in offered], "")


def test_completion_knows_the_commands(tmp_path):
    environment = {
        "_DYNHULL_COMPLETE": "complete_bash",
        "COMP_WORDS": "dynhull ve",
        "COMP_CWORD": "1",
        "HOME": str(tmp_path),
    }
    done = subprocess.run([COMMAND], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["verify"]
    assert "--show-completion" in dynhull("--help").stdout
