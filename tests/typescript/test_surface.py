"""What the TypeScript package has is what the Python SDK and the gateway have, name by name."""

import inspect
import json
import re
from pathlib import Path

import pytest
from cases import slow
from peers import program, typescript
from run_in import run

import dynhull_client as sdk

ROOT = Path(__file__).parents[2]
SOURCES = ROOT / "clients" / "typescript" / "src"
SNAKE = re.compile(r"_([a-z])")

# Names of the Python SDK, and why the package does without.
LEFT_OUT = {
    "address": "the URL that was given",
    "close": "nothing is open that `break`, `return` or a signal does not end",
    "ingest": "a writer does the same, exactly once",
    "pipeline": "promises: `Promise.all` of calls",
    "presence": "`onLost` of each stream",
    "with_token": "a new client with another token",
    "read_points": "the gateway has no such call; `entities` and `samplePoints`",
}
LEFT_OUT_OF_PAST = {
    "frontier": "the gateway answers it as of now alone",
    "phase_diagram": "the gateway answers it as of now alone",
    "list_held": "the gateway answers it as of now alone",
    "read_points": LEFT_OUT["read_points"],
}
LEFT_OUT_OF_COPIES = {
    **dict.fromkeys(
        ("centroid", "diameter", "width", "min_box", "min_circle", "min_perimeter_box", "label_point"),
        "`getMeasures` asks the server, `measures: true` has the usual ones in each event",
    ),
    "intersect_lines": "`intersectLines` asks the server",
    "copy": "vertices are never changed: whoever keeps them has a copy",
    "follow": "an async iterator with `copy` follows",
    "to_shapely": "shapely is a package of Python",
    "wkt": "`vertices.join`",
}
ADDED = {"feed_many", "ack_feed_many", "delete_feed_many_consumer"}  # the SDK's feed takes a prefix
ADDED_TO_WRITERS = dict.fromkeys(("insert", "delete", "move"), "a call each, in place of arguments of `put`")
# Parameters of the Python SDK that have another name, by the method or everywhere.
RENAMED = {
    "xy": "points",
    "time": "when",
    "for_": "for",
    "max_rate": "rate",
    "contents": "outlines",
    "batch_points": "batchRows",
    "ack_feed.after": "revision",
    "distance.xy": "about",
    "locate.xy": "about",
    "intersect_lines.p": "origins",
    "intersect_lines.q": "targets",
    "layers.k": "count",
    "set_quarantine.quarantine": "rules",
    "watch_many.prefix": "which",
    "watch_many.names": "which",
}
# Those that the package does without, and why.
NO_UID = "the place to go on after, which a stream keeps, has the uid"
NO_PARAMETER = {
    "timeout": "`signal`; the client has one for all calls",
    "prefix": "`feedMany`, `ackFeedMany`, `deleteFeedManyConsumer`",
    "progress_interval": "the gateway has the one of its `--keepalive`",
    "resume": "a stream resumes by itself",
    "follow": "a watch that is broken off after its first event",
    "directions": "the gateway has no sketches by directions; `maxVertices`",
    "outline": "events without outlines: `watchMany`",
    "get_hull.layer": "the gateway has `layers` for it",
    "list_held.min_revision": "the gateway has none",
    "watch.min_revision": "`waitForHull` has it",
    "watch_many.position": "a stream keeps its position",
    "watch_fence.max_rate": "the gateway has no rate of fences; `conflate`",
    "watch_fence.uid": NO_UID,
    "watch_alarm.uid": NO_UID,
    "feed.uid": NO_UID,
    "transfer.uids": "the gateway takes none",
    "writer.linger": "rows gather while others are under way",
    "writer.stop_on_error": "a writer stops at the first refusal",
    **dict.fromkeys(("put.insert", "put.delete", "put.move"), ADDED_TO_WRITERS["insert"]),
    **dict.fromkeys(("put.sequence", "remove.sequence"), "a writer counts its batches"),
}
TYPES = {
    "AlarmEvent": "AlarmEvent",
    "AlarmStatus": "AlarmStatus",
    "Alarm": "Alarm",
    "Applied": "Applied",
    "Batch": "Batch",
    "FeedBatch": "FeedEvent",
    "FeedConsumer": "FeedConsumer",
    "FenceEvent": "FenceEvent",
    "FenceSettings": "FenceSettings",
    "History": "History",
    "HullChange": "Change",
    "HullInfo": "HullInfo",
    "HullNow": "HullNow",
    "HullProgress": "Progress",
    "HullSnapshot": "Snapshot",
    "Measures": "Measures",
    "NewAlarm": "NewAlarm",
    "NewHull": "NewHull",
}


def camel(name: str) -> str:
    return SNAKE.sub(lambda found: found[1].upper(), name)


def methods(file: str) -> set[str]:
    """The names of the methods and getters of the class in a file."""
    return set(re.findall(r"^  (?:async )?(?:get )?\*?(\w+)\(", (SOURCES / file).read_text(), re.MULTILINE)) - {
        "constructor"
    }


def public(kind: type) -> set[str]:
    return {name for name, _ in inspect.getmembers(kind) if not name.startswith("_")}


def test_clients() -> None:
    theirs = public(sdk.AsyncHullClient)
    assert LEFT_OUT.keys() <= theirs
    ours = methods("client.js") | methods("streams.js") | methods("reads.js")
    shared = {camel(name) for name in theirs - LEFT_OUT.keys()}
    assert ours - {camel(name) for name in ADDED} == shared


def test_hulls_of_the_past() -> None:
    theirs = public(sdk.AsyncPast)
    assert LEFT_OUT_OF_PAST.keys() <= theirs
    assert methods("reads.js") == {camel(name) for name in theirs - LEFT_OUT_OF_PAST.keys()}


def test_copies() -> None:
    theirs = public(sdk.HullCopy)
    assert LEFT_OUT_OF_COPIES.keys() <= theirs
    assert {camel(name) for name in theirs - LEFT_OUT_OF_COPIES.keys()} <= methods("hull-copy.js")


def test_writers() -> None:
    theirs = public(sdk.AsyncWriter)
    assert methods("writer.js") - ADDED_TO_WRITERS.keys() == theirs
    assert ADDED_TO_WRITERS.keys() <= methods("writer.js")


@slow
def test_methods_have_the_parameters_of_the_python_sdk() -> None:
    said = run(
        program("node"),
        str(Path(__file__).with_name("parameters.mjs")),
        "tsconfig.json",
        "Client",
        "Writer",
        folder=typescript(),
    )
    ours = json.loads(said)
    missing, known = set(), set()
    for name, kind in (("Client", sdk.AsyncHullClient), ("Writer", sdk.AsyncWriter)):
        for method, call in inspect.getmembers(kind, callable):
            if method.startswith("_") or camel(method) not in ours[name]:
                continue
            for parameter in list(inspect.signature(call).parameters)[1:]:
                places = f"{method}.{parameter}", parameter
                renamed = next((RENAMED[place] for place in places if place in RENAMED), camel(parameter))
                if renamed in ours[name][camel(method)]:
                    known |= {place for place in places if place in RENAMED}
                elif place := next((place for place in places if place in NO_PARAMETER), None):
                    known.add(place)
                else:
                    missing.add(f"{name}.{method}: {parameter}")
    assert missing == set()
    assert known == RENAMED.keys() | NO_PARAMETER.keys(), "what is listed as missing or renamed is not"


def documented() -> dict[str, set[str]]:
    """The properties of each type that comments define."""
    text = "".join((SOURCES / name).read_text() for name in ("client.js", "streams.js", "watch.js"))
    found = re.finditer(r"@typedef \{object\} (\w+).*?(?=@typedef|\*/)", text, re.DOTALL)
    return {each[1]: set(re.findall(r"@property \{.*\} \[?(\w+)", each[0])) for each in found}


@slow
@pytest.mark.parametrize(("schema", "name"), TYPES.items())
def test_types_have_the_fields_of_the_gateways_description(schema: str, name: str) -> None:
    described = (ROOT / "tests" / "surface" / "goldens" / "openapi.txt").read_text()
    fields = set(re.findall(rf"^\.components\.schemas\.{schema}\.properties\.(\w+)", described, re.MULTILINE))
    assert fields, f"no schema {schema}"
    named = {camel(field) for field in fields}
    if schema.startswith("New"):
        named.remove("name")  # an argument of its own
    assert named <= documented()[name] | {"type"}
    assert documented()[name] - named <= {"type", "position"}  # what comes beside the data of events
