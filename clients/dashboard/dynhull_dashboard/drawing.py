"""What goes to the pages ten times a second, written once for all of them."""

import json
from dataclasses import dataclass, field

from dynhull_client.messages import Points as Points


@dataclass(frozen=True, slots=True)
class Drawing:
    """Points on the page.

    Attributes:
        source: the name of the page's data source that they are for.
        revision: the hull's, when they were so.
        points: (n, 2).
        message: all of this as the page reads it.
    """

    source: str
    revision: int
    points: Points
    message: str = field(init=False)

    def __post_init__(self) -> None:
        x, y = self.points.T.tolist()
        columns = {"source": self.source, "revision": self.revision, "x": x, "y": y}
        object.__setattr__(self, "message", json.dumps(columns))


def vertices_of(name: str) -> str:
    """The source of a hull's vertices."""
    return f"vertices of {name}"


def points_of(name: str) -> str:
    """The source of its other points."""
    return f"points of {name}"
