"""The watch of many hulls: what it asks for, and its state between messages and connections. No I/O."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

from dynhull_proto.v1 import hull_service_pb2 as pb

from ._arguments import positive
from ._many_messages import ManyChange, decode_now
from ._place import Place

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from ._errors import DynhullError
    from ._hull_copies import HullCopies

ManyContents = Literal["summary", "outline"]
CONTENTS: dict[ManyContents, pb.HullContents] = {
    "summary": pb.HULL_CONTENTS_SUMMARY,
    "outline": pb.HULL_CONTENTS_OUTLINE,
}


@dataclass(frozen=True, slots=True)
class WatchingMany:
    """A watch to begin."""

    request: pb.WatchManyRequest
    copies: HullCopies | None
    reconnect: bool
    timeout: float | None


def watch_many(
    prefix: str = "",
    *,
    names: Iterable[str] | None = None,
    contents: ManyContents | None = None,
    max_vertices: int | None = None,
    max_rate: float = 0.0,
    position: bytes | None = None,
    copies: HullCopies | None = None,
    reconnect: bool = True,
    timeout: float | None = None,
) -> WatchingMany:
    """Follow many hulls: their states, then the newest state of each that changes, is created or deleted.

    >>> from dynhull_client import HullClient, HullCopies
    >>> client, copies = HullClient(), HullCopies()  # doctest: +SKIP
    >>> for change in client.watch_many("fleet/", copies=copies):  # doctest: +SKIP
    ...     print(change.kind, change.hull, len(copies))

    A program that reads slowly gets newer states, not a longer queue.

    Args:
        prefix: the hulls whose names begin with this: all by default.
        names: in place of a prefix, the hulls that have these names, or will have them.
        contents: "summary", counts and measures, or "outline", the vertices, too. By default a summary, with copies an
            outline.
        max_vertices: with outlines, at most this many of the vertices of each, from 1 to 1000.
        max_rate: the most states of a hull a second, at least one a day; 0 for 10.
        position: that of an earlier change: the watch goes on from there, and says "unchanged" of the other hulls.
        copies: copies that the watch itself updates before it returns a change; it goes on from where they are.
        reconnect: whether the watch continues after a lost connection, however long that takes, from where it was.
            Without it, UnavailableError ends the watch. Until it has begun it is tried again as other reads are.
        timeout: seconds after which the watch ends with DeadlineError; None for never.
    """
    if names is not None and prefix:
        raise ValueError("give a prefix or names, not both")
    if contents is None:
        contents = "summary" if copies is None else "outline"
    if contents not in CONTENTS:
        raise ValueError(f"contents must be one of {', '.join(CONTENTS)}, got {contents!r}")
    if copies is not None:
        if contents != "outline" or max_vertices is not None:
            raise ValueError('copies have all vertices: give neither max_vertices nor contents="summary"')
        if position is not None:
            raise ValueError("give either copies, which know where they are, or a position, not both")
        position = copies.position
    wanted = None if names is None else [names] if isinstance(names, str) else list(names)
    if wanted is not None and not wanted:
        raise ValueError("names must have at least one")
    request = pb.WatchManyRequest(
        prefix=prefix,
        names=wanted,
        contents=CONTENTS[contents],
        max_vertices=positive("max_vertices", max_vertices),
        max_events_per_second=max_rate,
        position=position or b"",
    )
    return WatchingMany(request, copies, reconnect, timeout)


class ManyPlace(Place[ManyChange]):
    """What a watch of many hulls has received, and what it requests next."""

    method = "WatchMany"
    request: pb.WatchManyRequest

    def __init__(self, watching: WatchingMany, retries: int) -> None:
        super().__init__(watching.timeout, watching.reconnect, retries)
        self.request = pb.WatchManyRequest()
        self.request.CopyFrom(watching.request)
        self._copies = watching.copies
        self._known: dict[str, tuple[str, int]] = {}
        if watching.copies is not None:
            self._known = {name: (copy.uid, copy.revision) for name, copy in watching.copies.items()}
        self._named: set[str] | None = None

    @property
    def subject(self) -> str:
        """What is watched, for people."""
        return f"{len(self.request.names)} hulls" if self.request.names else f"{self.request.prefix}*"

    def take(self, message: pb.WatchManyResponse) -> Sequence[ManyChange]:
        """The changes of a message, without states that the caller has."""
        self._connected()
        changes = list(self._taken(message))
        if message.position:
            self.request.position = message.position
        if changes and message.position:
            changes[-1] = replace(changes[-1], position=message.position)
        if self._copies is not None:
            for change in changes:
                self._copies.update(change)
        return changes

    def end(self, error: DynhullError) -> Sequence[ManyChange]:
        """Prepare the next connection after one has ended; raises the error if there is none."""
        self.lost = error
        self._named = None
        self._continue_later(error)
        return ()

    def _report_connection(self) -> None:
        """Nothing to ask for: a watch begins with a picture, and has a mark each second."""

    def _taken(self, message: pb.WatchManyResponse) -> Iterable[ManyChange]:
        position = self.request.position or None
        if message.picture in (pb.PICTURE_BEGINS, pb.PICTURE_BEGINS_ANEW):
            self._named = set()
            if message.picture == pb.PICTURE_BEGINS_ANEW:
                position = None
                self.request.position = b""
                self._known = dict.fromkeys(self._known, ("", -1))
                yield ManyChange("restored")
        for hull in message.hulls:
            if self._named is not None:
                self._named.add(hull.name)
            if self._is_news(hull):
                yield decode_now(hull, position)
        if message.picture == pb.PICTURE_COMPLETE:
            for name in [name for name in self._known if self._named is not None and name not in self._named]:
                del self._known[name]
                yield ManyChange("gone", name, position)
            self._named = None
            yield ManyChange("complete", "", position)
        elif message.position:
            yield ManyChange("position", "", position)

    def _is_news(self, hull: pb.HullNow) -> bool:
        if hull.presence == pb.HULL_PRESENCE_GONE:
            return self._known.pop(hull.name, None) is not None
        if hull.presence == pb.HULL_PRESENCE_UNCHANGED:
            return hull.name not in self._known
        now = hull.uid, hull.revision
        if self._known.get(hull.name) == now:
            return False
        self._known[hull.name] = now
        return True
