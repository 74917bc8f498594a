"""Points as sent to the pages, serialized once for all of them."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

from dynhull_client import Points as Points


@dataclass(frozen=True, slots=True)
class Drawing:
    """Points of a hull on the page.

    Attributes:
        kind: which of its points.
        hull: the name of the hull.
        revision: its revision with these points.
        points: float64 array of shape (n, 2).
        keys: the key of each point; None in a hull without keys.
        rings: the outline in a flat map of degrees, of a hull on the globe; None for the polygon of these points.
        message: all of these as JSON.
    """

    kind: Literal["vertices", "points"]
    hull: str
    revision: int
    points: Points
    keys: Sequence[str | int] | None = None
    rings: Sequence[Points] | None = None
    message: str = field(init=False)

    def __post_init__(self) -> None:
        x, y = self.points.T.tolist()
        # As text: a browser's numbers are doubles, and integer keys may be larger.
        keys = None if self.keys is None else [str(key) for key in self.keys]
        rings = None if self.rings is None else [ring.tolist() for ring in self.rings]
        named = {"kind": self.kind, "hull": self.hull, "revision": self.revision}
        object.__setattr__(self, "message", json.dumps({**named, "x": x, "y": y, "keys": keys, "rings": rings}))
