"""What one way to the server can do or say, the others can, too. What differs is named here, with its reason."""

import dataclasses
import inspect
import json
from collections.abc import Iterable
from typing import Any, get_args, get_type_hints

import pytest
from command_line import dynhull
from google.protobuf.descriptor import Descriptor

import dynhull_client
from dynhull_client import AsyncHullClient, DynhullError, HullClient
from dynhull_gateway import schemas
from dynhull_gateway.events import documents
from dynhull_proto.v1 import batch_pb2, fence_pb2, hull_pb2, hull_service_pb2
from dynhull_server.rpc.status import ANSWERED, REFUSALS
from dynhull_surface.counts import COUNTS
from dynhull_surface.names import find
from dynhull_surface.reasons import REASONS, Code

# Answers of the SDK, and those over HTTP that have another name.
OVER_HTTP = {
    "ChanRound": "ChanRound",
    "Applied": "Applied",
    "Counted": "Counted",
    "Efficient": "Efficient",
    "Entities": "Entities",
    "Fence": "Fence",
    "FenceConsumer": "Consumer",
    "HeldPosition": "HeldPosition",
    "Hull": "Hull",
    "HullInfo": "HullInfo",
    "Inside": "Inside",
    "Layers": "Layers",
    "Located": "Located",
    "Distances": "Distances",
    "Influence": "Influence",
    "Phases": "Phases",
    "Positions": "Positions",
    "Quarantine": "PresentRules",
    "Sampled": "Sampled",
    "Separation": "Separation",
    "Series": "Series",
    "SubjectsInside": "SubjectsInside",
    "Supported": "Supported",
    "Tangents": "Tangents",
    "Verification": "Verification",
    "FenceDifference": "FenceDifference",
    "Window": "Window",
}


# What an answer over HTTP has inside of another one, or has no use for.
NOT_OVER_HTTP = {"Hull": {"revision"}}  # that of its info
NOT_IN_EVENTS = {
    "Snapshot": {"uid", "cause", "clock"},  # the present state, which is not that of one event
    "Change": {"uid"},  # which the id of the event says
    "Progress": {"uid"},
}


def fields(kind: Any) -> set[str]:
    """What an answer of the SDK says."""
    named = {each.name for each in dataclasses.fields(kind)}
    shown = {name for name, each in vars(kind).items() if isinstance(each, property) and not name.startswith("_")}
    return named | shown


@pytest.mark.parametrize(("answer", "over_http"), OVER_HTTP.items())
def test_http_answers_all_that_the_sdk_does(answer: str, over_http: str) -> None:
    model = getattr(schemas, over_http)
    said = fields(getattr(dynhull_client, answer)) - NOT_OVER_HTTP.get(answer, set())
    assert said - set(model.model_fields) == set()


def test_every_field_of_an_event_of_a_fence_is_described() -> None:
    described = documents.FenceEvent
    sent = fields(dynhull_client.FenceEvent) - {"after"}  # which the id of the event says
    assert sent == set(described.model_fields)
    types = get_type_hints(dynhull_client.FenceEvent)["type"], get_type_hints(described)["type"]
    assert get_args(types[0]) == get_args(types[1])


@pytest.mark.parametrize("event", ["Snapshot", "Change", "Progress"])
def test_every_field_of_an_event_of_a_hull_is_described(event: str) -> None:
    sent = fields(getattr(dynhull_client, event)) - NOT_IN_EVENTS[event]
    assert sent - set(getattr(documents, f"Hull{event}").model_fields) == set()


def test_what_is_described_is_all_that_is_sent() -> None:
    for model in (documents.FenceEvent, documents.HullSnapshot, documents.HullChange, documents.HullProgress):
        assert model.model_config.get("extra") != "allow", model


@pytest.mark.parametrize("count", COUNTS)
def test_every_count_is_everywhere(count: str) -> None:
    for message in (batch_pb2.BatchResult, hull_service_pb2.IngestResponse):
        assert count in message.DESCRIPTOR.fields_by_name
    for kind in (dynhull_client.Applied, dynhull_client.Ingested):
        assert count in fields(kind)
    for model in (schemas.Applied, schemas.Uploaded):
        assert count in model.model_fields


# Arguments of calls that are in no body over HTTP: where they are instead.
ELSEWHERE = {
    "name": "the path",
    "producer": "Idempotency-Key",
    "sequence": "Idempotency-Key",
    "may_skip": "the query",
    "timeout": "the gateway's own",
    "layer": "the query",
    "min_revision": "the query",
}
BODIES = [
    ("create_hull", schemas.NewHull, {}),
    ("create_fence", schemas.NewFence, {"subjects": "subjects"}),
    ("replace_fence", schemas.FenceSettings, {}),
    ("set_quarantine", schemas.QuarantineRules, {"quarantine": "max_speed"}),
    ("apply", schemas.Batch, {}),
    ("put", schemas.Batch, {}),
    ("remove", schemas.Batch, {"keys": "remove"}),
    ("release", schemas.Batch, {"keys": "release"}),
    ("drop", schemas.Batch, {"keys": "drop"}),
    ("locate", schemas.AboutPointsOrKeys, {"xy": "points"}),
    ("distance", schemas.AboutPointsOrKeys, {"xy": "points"}),
    ("count", schemas.AboutPoints, {"xy": "points"}),
    ("tangents", schemas.AboutPoints, {"xy": "points"}),
    ("support", schemas.Directions, {}),
    ("intersect_lines", schemas.Lines, {"p": "origins", "q": "targets"}),
    ("positions", schemas.AboutKeys, {}),
    ("phase_diagram", schemas.Entries, {}),
    ("frontier", schemas.FrontierQuestion, {}),
    ("recenter", schemas.Recenter, {}),
    ("reshard", schemas.Reshard, {}),
    ("set_history", schemas.KeptHistory, {}),
    ("erase_history", schemas.ErasedKeys, {}),
]


@pytest.mark.parametrize(("call", "body", "renamed"), BODIES, ids=[call for call, _, _ in BODIES])
def test_every_argument_of_a_call_is_in_the_body(call: str, body: Any, renamed: dict[str, str]) -> None:
    arguments = list(inspect.signature(getattr(HullClient, call)).parameters)[1:]
    lacking = [each for each in arguments if renamed.get(each, each) not in body.model_fields]
    assert [each for each in lacking if each not in ELSEWHERE] == []


@pytest.mark.parametrize("call", [name for name in dir(HullClient) if not name.startswith("_")])
def test_both_clients_have_the_same_calls(call: str) -> None:
    sync, asynchronous = getattr(HullClient, call), getattr(AsyncHullClient, call)
    if callable(sync):
        assert inspect.signature(sync).parameters == inspect.signature(asynchronous).parameters


# Of an answer of the SDK, what commands print in parts or under another name.
IN_JSON = {
    "window": ("max_age", "max_points", "window_clock", "max_skew", "ahead"),
    "quarantine": ("max_speed", "max_growth", "confirmations"),
}


def test_commands_say_all_that_the_sdk_does(address: str, name: str) -> None:
    """One object of JSON for each answer."""
    with HullClient(address) as client:
        client.create_hull(name, keyed="str", max_age=3600)
        client.create_fence(name, dynhull_client.Circle(0, 0, 1), name)
        client.put(name, ["a"], [(0, 0)])

    def said(*words: str) -> dict[str, Any]:
        answer = dynhull(*words, "--json", "--address", address)
        return json.loads(answer.stdout.splitlines()[0])  # type: ignore[no-any-return]

    for words, answer in (
        (["list", name], dynhull_client.HullInfo),
        (["fences", "list", name], dynhull_client.Fence),
        (["verify", name], dynhull_client.Verification),
        (["put", name, "a", "0", "0"], dynhull_client.Applied),
        (["fences", "inside", name], dynhull_client.Inside),
    ):
        expected = [part for each in sorted(fields(answer)) for part in IN_JSON.get(each, (each,))]
        assert set(expected) - set(said(*words)) == set(), words


def errors(kind: type[DynhullError] = DynhullError) -> Iterable[type[DynhullError]]:
    for each in kind.__subclasses__():
        if each.__module__.startswith("dynhull_client"):
            yield each
            yield from errors(each)


# Errors of the SDK alone: what it finds itself.
OWN_ERRORS = {"StaleCopyError"}


def test_every_error_has_a_reason_or_a_code() -> None:
    known = {reason.error for reason in REASONS.values()} | {code.error for code in Code}
    for error in errors():
        assert error.__name__ in known | OWN_ERRORS
        assert error.__name__ in dynhull_client.__all__
    assert known <= set(dynhull_client.__all__)


def test_every_refusal_of_the_server_has_a_reason() -> None:
    assert {each.reason for each in REFUSALS.values()} <= set(REASONS)
    assert all(issubclass(each, ANSWERED) for each in REFUSALS)


def paths(message: Descriptor, path: str) -> Iterable[str]:
    """The paths that refusals may name: those of all fields but the parts of points, keys, times and durations."""
    for field in message.fields:
        here = f"{path}.{field.name}"
        yield here
        if field.message_type is not None and field.message_type.name in WITH_FIELDS:
            yield from paths(field.message_type, here)


WITH_FIELDS = {"CircleArea", "HullArea", "Moves", "Puts", "Quarantine", "Window"}
# Fields that commands have no option for: their own rows, or what they never send.
WITHOUT_OPTION = ("batch.", "config.quarantine", "config.circle_area.", "config.area")
CONFIGS = [
    (hull_pb2.HullConfig, schemas.NewHull, ["create"], "config"),
    (fence_pb2.FenceConfig, schemas.NewFence, ["fences", "create"], "config"),
    (batch_pb2.Batch, schemas.Batch, ["put"], "batch"),
]


@pytest.mark.parametrize(("config", "body", "command", "root"), CONFIGS, ids=["hull", "fence", "batch"])
def test_every_field_that_can_be_refused_has_a_place_and_an_option(
    config: Any, body: Any, command: list[str], root: str
) -> None:
    helped = dynhull(*command, "--help").stdout
    for path in paths(config.DESCRIPTOR, root):
        found = find(path)
        assert found is not None, path
        assert found.path != root, path
        if found.json:
            assert found.json[0] in body.model_fields, path
        option = found.option
        if option.startswith("--") and not path.startswith(WITHOUT_OPTION):
            assert all(each in helped for each in option.split(" or ")), (path, option)
