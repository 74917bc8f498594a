"""Points as sent to the pages, serialized once for all of them."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field

from dynhull_client import Points as Points


@dataclass(frozen=True, slots=True)
class Drawing:
    """Points on the page.

    Attributes:
        source: the name of the data source on the page.
        revision: the revision of the hull with these points.
        points: float64 array of shape (n, 2).
        keys: the key of each point; None in a hull without keys.
        rings: the outline, if it is not the polygon of these points: a ring or more to be filled.
        message: all of these as JSON.
    """

    source: str
    revision: int
    points: Points
    keys: Sequence[str | int] | None = None
    rings: Sequence[Points] | None = None
    message: str = field(init=False)

    def __post_init__(self) -> None:
        x, y = self.points.T.tolist()
        # As text: a browser's numbers are doubles, and integer keys may be larger.
        keys = None if self.keys is None else [str(key) for key in self.keys]
        rings = None if self.rings is None else [ring.T.tolist() for ring in self.rings]
        columns = {"source": self.source, "revision": self.revision, "x": x, "y": y, "keys": keys, "rings": rings}
        object.__setattr__(self, "message", json.dumps(columns))


def vertices_of(name: str) -> str:
    """The name of the data source of a hull's vertices."""
    return f"vertices of {name}"


def outline_of(name: str) -> str:
    """The name of the data source of its outline, which the page makes of what it gets for the vertices."""
    return f"outline of {name}"


def points_of(name: str) -> str:
    """The name of the data source of its other points."""
    return f"points of {name}"
