"""The OpenAPI document: of what the routes declare, and what holds for all of them.

Programs that make clients take it as it is: what requests may leave out is marked so, and an answer has one type.
"""

import json
from collections.abc import Iterable, Iterator
from typing import Any

from fastapi import FastAPI
from pydantic import BaseModel

from .bodies import JSON
from .ogc.documents import FeatureCollection, Item
from .problems import Problem
from .schemas import Batch, Feature

# What the descriptions of routes refer to by name.
REFERRED: tuple[type[BaseModel], ...] = (Problem, Batch, Feature, FeatureCollection, Item)
REFERENCE = "#/components/schemas/"


def description_of(app: FastAPI, events: Iterable[type[BaseModel]]) -> dict[str, Any]:
    """The document of an application.

    Args:
        app: the application.
        events: what the data of events looks like.
    """
    if app.openapi_schema is None:
        made = FastAPI.openapi(app)
        schemas = made["components"]["schemas"]
        for model in (*REFERRED, *events):
            own = model.model_json_schema(ref_template=REFERENCE + "{model}")
            schemas |= {**own.pop("$defs", {}), model.__name__: own}
        for path in made["paths"].values():
            for operation in path.values():
                _describe(operation)
        for unused in ("HTTPValidationError", "ValidationError"):
            schemas.pop(unused, None)
        for name in _requested(made):
            _without_defaults(schemas[name])
        app.openapi_schema = made
    return app.openapi_schema


def _describe(operation: dict[str, Any]) -> None:
    operation["responses"].pop("422", None)  # the framework's own; ours are 400
    contents = operation["responses"].get("200", {}).get("content", {})
    for content in contents.values():
        if "$ref" in content["schema"]:
            content["schema"].pop("type", None)  # "string", the framework's guess
    if JSON in contents and len(contents) > 1:  # whoever asks for GeoJSON knows
        operation["responses"]["200"]["content"] = {JSON: contents[JSON]}
    operation.setdefault("security", []).append({})  # a server without tokens needs none


def _requested(made: dict[str, Any]) -> set[str]:
    """The names of the schemas in bodies of requests."""
    found: set[str] = set()
    waiting = [operation.get("requestBody", {}) for path in made["paths"].values() for operation in path.values()]
    while waiting:
        for reference in _references(waiting.pop()):
            name = reference.removeprefix(REFERENCE)
            if name not in found:
                found.add(name)
                waiting.append(made["components"]["schemas"][name])
    return found


def _references(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        if isinstance(value.get("$ref"), str):
            yield value["$ref"]
        for each in value.values():
            yield from _references(each)
    elif isinstance(value, list):
        for each in value:
            yield from _references(each)


def _without_defaults(schema: dict[str, Any]) -> None:
    """Say defaults in words: programs take a field with one for a field that is always there."""
    for field in schema.get("properties", {}).values():
        default = field.pop("default", None)
        if default not in (None, [], {}):
            words = f"Usually {json.dumps(default)}."
            field["description"] = " ".join(filter(None, (field.get("description"), words)))
