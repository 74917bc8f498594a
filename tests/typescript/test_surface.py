"""What the TypeScript package has is what the Python SDK and the gateway have, name by name."""

import inspect
import re
from pathlib import Path

import pytest

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


def documented() -> dict[str, set[str]]:
    """The properties of each type that comments define."""
    text = "".join((SOURCES / name).read_text() for name in ("client.js", "streams.js", "watch.js"))
    found = re.finditer(r"@typedef \{object\} (\w+).*?(?=@typedef|\*/)", text, re.DOTALL)
    return {each[1]: set(re.findall(r"@property \{.*\} \[?(\w+)", each[0])) for each in found}


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
