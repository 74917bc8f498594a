"""What the documents of the standard look like."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field
from pydantic.alias_generators import to_camel

from ..schemas import Feature

CRS84 = "http://www.opengis.net/def/crs/OGC/1.3/CRS84"
CONFORMANCE = [
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/core",
    "http://www.opengis.net/spec/ogcapi-features-1/1.0/conf/geojson",
]
JSON = "application/json"
OPENAPI = "application/vnd.oai.openapi+json;version=3.1"
SCHEMA = "application/schema+json"


class Document(BaseModel):
    """A document whose names are those of the standard: numberReturned for number_returned."""

    model_config = ConfigDict(alias_generator=to_camel, populate_by_name=True)


class Link(BaseModel):
    """A link (RFC 8288)."""

    href: str
    rel: str
    type: str
    title: str


class Landing(BaseModel):
    """Where to go from here."""

    title: str
    description: str
    links: list[Link]


class Conformance(Document):
    """The classes of requirements that are met."""

    conforms_to: list[str]


class Spatial(BaseModel):
    """Boxes that the features are in: west, south, east, north."""

    bbox: list[Annotated[list[float], Field(min_length=4, max_length=4)]]
    crs: str = CRS84


class Temporal(BaseModel):
    """Times of which the features can be had: a beginning and an end, null for none."""

    interval: list[Annotated[list[str | None], Field(min_length=2, max_length=2)]]
    trs: str = "http://www.opengis.net/def/uom/ISO-8601/0/Gregorian"


class Extent(BaseModel):
    """Where and when the features are."""

    spatial: Spatial | None = None
    temporal: Temporal | None = None


class Collection(Document):
    """Features of one kind."""

    id: str
    title: str
    description: str
    links: list[Link]
    extent: Extent | None = None
    item_type: Literal["feature"] = "feature"
    crs: list[str] = [CRS84]


class Collections(BaseModel):
    """The collections that the caller may read."""

    links: list[Link]
    collections: list[Collection]


class Item(Feature):
    """A feature on its own."""

    links: list[Link]


class FeatureCollection(Document):
    """A page of features."""

    type: Literal["FeatureCollection"] = "FeatureCollection"
    features: list[Feature]
    links: list[Link]
    time_stamp: str
    number_returned: int
    number_matched: int | None = None


def schema_of_entities(url: str, name: str, keyed: str) -> dict[str, Any]:
    """The JSON schema of the keys of a hull as features: tells maps the types of properties that some features lack.

    GDAL takes an integer for one of 32 bits, and reads the type from the features where the schema has none. So integer
    keys have none.
    """
    key = {"key": {"type": "string"}} if keyed == "str" else {}
    time = {"type": "string", "format": "date-time", "description": "Event time; absent where there is none."}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "$id": url,
        "title": f"Entities of {name}",
        "type": "object",
        "required": ["type", "id", "geometry", "properties"],
        "properties": {
            "type": {"const": "Feature"},
            "id": {"type": "string" if keyed == "str" else "integer"},
            "geometry": {"$ref": "https://geojson.org/schema/Point.json"},
            "properties": {"type": "object", "required": ["key"], "properties": {**key, "time": time}},
        },
    }
