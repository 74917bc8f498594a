"""The calls of the SDK, which write the settings of hulls and of fences out for type checkers, have all of them."""

import inspect
from collections.abc import Iterable
from datetime import timedelta
from typing import Any

import pytest
from google.protobuf.descriptor import Descriptor

from dynhull_client import AsyncHullClient, HullClient
from dynhull_proto.v1 import fence_pb2, hull_pb2
from dynhull_surface import settings as surface
from dynhull_surface.described import described
from dynhull_surface.settings import FenceSettings, HullSettings

CALLS = {"create_hull": HullSettings, "create_fence": FenceSettings, "replace_fence": FenceSettings}
# What has another form in each of the calls.
OWN = {
    "self",
    "name",
    "area",
    "subjects",
    "other_hull",
    "expected",
    "quarantine",
    "history",
    "history_bytes",
    "exist_ok",
    "timeout",
}
# As they are written.
KINDS = {
    timedelta: "float | timedelta | str",
    tuple[float, float]: "tuple[float, float]",
    int: "int",
    float: "float",
    bool: "bool",
    str: "str",
    surface.Ahead: "Ahead",
    surface.Boundary: "Boundary",
    surface.Clock: "Clock",
    surface.Initial: "Initial",
    surface.Keyed: "KeyType",
    surface.Ordering: "Ordering",
}


@pytest.mark.parametrize("client", [HullClient, AsyncHullClient])
@pytest.mark.parametrize("call", CALLS)
def test_arguments(client: type, call: str) -> None:
    arguments = inspect.signature(getattr(client, call)).parameters
    settings = [each for each in described(CALLS[call]) if call.startswith("create") or not each.at_creation]
    assert arguments.keys() - OWN == {each.name for each in settings}
    for each in settings:
        argument = arguments[each.name]
        optional = " | None" if each.usual is None else ""
        assert (argument.default, str(argument.annotation)) == (each.usual, f"{KINDS[each.kind]}{optional}"), each.name


@pytest.mark.parametrize("call", ["create_hull", "create_fence"])
def test_documentation(call: str) -> None:
    said = " ".join(str(inspect.getdoc(getattr(HullClient, call))).split())
    for each in described(CALLS[call]):
        assert f" {each.name}: {each.meaning[0].lower()}{each.meaning[1:]}" in said


# Areas, subjects, a quarantine and a history have a form of their own, in messages of their own.
WITHOUT_SETTING = {
    "area",
    "subject_hull",
    "subject_prefix",
    "other_hull",
    "polygon_area",
    "circle_area",
    "hull_area.name",
    "expected",
    "quarantine",
    "history",
}


@pytest.mark.parametrize(
    ("settings", "message"), [(HullSettings, hull_pb2.HullConfig), (FenceSettings, fence_pb2.FenceConfig)]
)
def test_every_field_on_the_wire_is_a_setting(settings: type, message: Any) -> None:
    assert {each.path for each in described(settings)} == set(paths(message.DESCRIPTOR)) - WITHOUT_SETTING


def paths(message: Descriptor, above: str = "") -> Iterable[str]:
    for field in message.fields:
        if field.message_type is not None and field.message_type.name in ("Window", "HullArea"):
            yield from paths(field.message_type, f"{field.name}.")
        else:
            yield f"{above}{field.name}"
