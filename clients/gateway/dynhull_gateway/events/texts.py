"""The events of one hull as text, in the form that a reader asks for."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from dynhull_client import Deleted, Event, HullCopy, Measures, Progress, Sketch, Snapshot

from .messages import message

if TYPE_CHECKING:
    from datetime import datetime

Form = Literal["changes", "vertices", "geojson"]


@dataclass(frozen=True, slots=True)
class View:
    """What of a hull is followed, and in which form events show it."""

    token: str | None
    name: str
    form: Form
    rate: float
    keys: bool
    measures: bool
    layer: int = 1
    max_vertices: int | None = None

    def options(self) -> dict[str, Any]:
        """What a watch or a replay asks for."""
        return {
            "max_rate": self.rate,
            "keys": self.keys,
            "measures": self.measures,
            "layer": self.layer,
            "max_vertices": self.max_vertices,
        }


class HullTexts:
    """Makes the texts.

    Args:
        view: what of the hull, and in which form.

    Attributes:
        copy: the hull, which a watch updates.
        known: whether the copy holds it.
    """

    def __init__(self, view: View) -> None:
        self.copy = HullCopy()
        self.known = False
        self._view = view
        self._measures: Measures | None = None
        self._changed: datetime | None = None
        self._erased = False
        self._error: float | None = None  # how far the hull reaches beyond the vertices of a sketch
        self._snapshot: bytes | None = None

    def take(self, event: Event) -> bytes:
        """The text of an event, which the copy has."""
        self._snapshot = None
        self.known = not isinstance(event, Deleted)
        if isinstance(event, Deleted):
            return message("deleted", "", {"revision": event.revision})
        if isinstance(event, Sketch):
            self._error = event.error
            event = _whole_sketch(event)
            self.copy.update(event)
        self._changed, self._erased = event.changed, event.erased
        if not isinstance(event, Progress):
            self._measures = event.measures
        if isinstance(event, Snapshot) or (self._view.form != "changes" and not isinstance(event, Progress)):
            return self.whole()
        kind = type(event).__name__.lower()
        return message(kind, self.ident(), {name: value for name, value in shown(event).items() if name != "uid"})

    def whole(self) -> bytes:
        """The hull as it is now. O(h) once per event."""
        if self._snapshot is None:
            self._snapshot = message("snapshot", self.ident(), self._state())
        return self._snapshot

    def ident(self) -> str:
        """None for a sketch: each is complete, so that a reader who connects again needs no place."""
        return f"{self.copy.uid}:{self.copy.revision}" if self.copy.uid else ""

    def _state(self) -> dict[str, Any]:
        copy = self.copy
        head: dict[str, Any] = {"revision": copy.revision, "points": copy.points}
        if self._measures is not None:
            head["measures"] = shown(self._measures)
        if self._changed is not None:
            head["changed"] = self._changed
        if self._erased:
            head["erased"] = True
        if self._error is not None:
            head["error"] = self._error
        if self._view.form == "geojson":
            geometry = copy.__geo_interface__ if len(copy.vertices) else None
            return {"type": "Feature", "id": self._view.name, "geometry": geometry, "properties": head}
        keys = {"vertex_keys": copy.vertex_keys} if self._view.keys else {}
        return {**head, "vertices": copy.vertices.tolist(), **keys, "center": copy.center}


def shown(value: Any) -> dict[str, Any]:
    """A value of the SDK as JSON has it, without what is not there."""
    named = {name: getattr(value, name) for name in value.__dataclass_fields__}
    return {name: _plain(each) for name, each in named.items() if each is not None and each is not False}


def _whole_sketch(sketch: Sketch) -> Snapshot:
    """A sketch as the snapshot of a hull that has only these vertices."""
    head = sketch.revision, sketch.points, sketch.vertices, sketch.measures
    return Snapshot(*head, vertex_keys=sketch.keys, center=sketch.center, changed=sketch.changed, erased=sketch.erased)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    return shown(value) if isinstance(value, Measures) else value
