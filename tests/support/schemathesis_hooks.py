"""What Schemathesis has to know about the gateway: how bodies of rows are sent."""

import json

import schemathesis


@schemathesis.serializer("application/x-ndjson", "application/geo+json", "application/geo+json-seq")
def as_text(_: object, value: object) -> bytes:
    return (value if isinstance(value, str) else json.dumps(value)).encode("utf-8", "surrogatepass")


@schemathesis.hook
def filter_query(_: object, query: dict[str, object] | None) -> bool:
    """Ask for no GeoJSON: an answer that may be JSON or GeoJSON is described as JSON, the type that programs expect."""
    return (query or {}).get("f") != "geojson"
