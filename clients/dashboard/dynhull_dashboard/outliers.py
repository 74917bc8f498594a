"""What stretches a hull: its inner convex layers, and the vertex that matters most. Asked while a viewer looks."""

import asyncio
import json
from collections.abc import Iterable
from typing import Any

from dynhull_client import AsyncHullClient, DynhullError, Influence, Points, UnavailableError

from .cards import number
from .degrees import SQUARE_KILOMETRE, outline, position_text, shown, shown_place
from .feed import HullFeed
from .feeds import Feeds
from .outline import drawn
from .repeating import repeat

# The layers that are drawn; the first is the hull itself.
LAYERS = 5
LOOK_SECONDS = 0.5


class OutlierFeed:
    """The inner layers and the most influential vertex of a hull, kept up to date until closed.

    Args:
        client: the connection.
        hulls: the feeds of the hulls; that of this one is kept open.
        area_unit: the unit of areas in a plane.
        name: the hull.

    Attributes:
        message: both as JSON for the picture; None before the first answer.
        words: the vertex and its area, or why there is none, as a sentence and what changes more often.
    """

    def __init__(self, client: AsyncHullClient, hulls: Feeds[HullFeed], area_unit: str, name: str) -> None:
        self.message: str | None = None
        self.words = "", ""
        self._client = client
        self._hulls = hulls
        self._hull = hulls.open(name)
        self._area_unit = area_unit
        self._name = name
        self._revision = -1
        self._task = asyncio.create_task(repeat(name, self._look, lambda: LOOK_SECONDS))

    async def close(self) -> None:
        """Stop asking."""
        self._task.cancel()
        await asyncio.wait([self._task])
        self._hulls.release(self._name)

    async def _look(self) -> None:
        hull = self._hull
        if not hull.followed:
            self._show((), None)  # it is not there, or not yet
            self._revision = -1
            return
        if hull.revision == self._revision:
            return
        try:
            layers = await self._client.layers(self._name, LAYERS)
            influence = await self._client.influence(self._name, keys=hull.keyed)
        except UnavailableError:
            raise  # what was last seen stays
        except DynhullError as error:
            self._show((), None, f"{self._name}: {error}")
            raise
        self._revision = min(layers.revision, influence.revision)
        self._show(layers.layers[1:], influence)

    def _show(self, layers: Iterable[Points], influence: Influence | None, trouble: str = "") -> None:
        found: dict[str, Any] = {"vertex": None, "label": ""}
        self.words = trouble or f"{self._name} has no vertex that changes its area", ""
        if influence is not None and influence.areas.any():
            row = int(influence.areas.argmax())
            key = None if influence.keys is None else str(influence.keys[row])
            area = self._area(float(influence.areas[row]))
            x, y = influence.vertices[row].tolist()
            x, y = shown_place(x, y, self._hull.center)
            found = {"vertex": [x, y], "label": area if key is None else f"{key}: {area}"}
            vertex = "its most influential vertex" if key is None else key
            at = f"{position_text(x, y, self._hull.center)}, revision {influence.revision:,}"
            self.words = f"Without {vertex}, {self._name} would lose {area}", at
        drawings = [self._drawing(layer) for layer in layers]
        message = json.dumps({"kind": "outliers", "hull": self._name, "layers": drawings, **found})
        if message != self.message:
            self.message = message

    def _area(self, area: float) -> str:
        return (
            f"{number(area)} {self._area_unit}"
            if self._hull.center is None
            else f"{number(area / SQUARE_KILOMETRE)} km²"
        )

    def _drawing(self, layer: Points) -> dict[str, Any]:
        """The outline of a layer, in the form of a drawing of vertices."""
        center, corners = self._hull.center, layer[drawn(len(layer))]
        x, y = shown(corners, center).T.tolist()
        rings = None if center is None else [ring.tolist() for ring in outline(corners, center)]
        return {"x": x, "y": y, "keys": None, "rings": rings}
