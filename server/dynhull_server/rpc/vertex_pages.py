"""Vertices in pages: those of one revision are kept while a caller reads them, whatever becomes of the hull."""

import asyncio
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from dynhull.arrays import Points
from dynhull.keys import PackedKeys
from dynhull_proto.v1 import hull_service_pb2 as pb

from ..engine.live_hull import LiveHull
from ..engine.steps import Run
from ..engine.threads import Clock
from ..state.errors import PagesForgottenError
from ..state.hull_state import Counts
from ..state.records import Keys
from . import decode, encode

# The bytes of a page, about: less than the 4 MiB that a gRPC client receives by default.
PAGE_BYTES = 3 * 2**20
# Seconds for which vertices are kept after a page of them was read, and the bytes of all that are kept, about.
KEPT_SECONDS, KEPT_BYTES = 60.0, 64 * 2**20
# The bytes of a vertex in a page: of its coordinates, and of its key beside the characters of a string.
POINT_BYTES, KEY_BYTES = 16, 10
TOKEN = re.compile(r"(?P<uid>[^:]+):(?P<revision>[0-9]{1,20}):(?P<first>[0-9]{1,20})")


@dataclass(frozen=True, slots=True)
class Page:
    """A page that a caller asks for.

    Attributes:
        size: the largest number of vertices.
        uid: of the hull whose pages the caller reads; empty for the first page.
        revision: their revision.
        first: the first row of the page.
    """

    size: int
    uid: str = ""
    revision: int = 0
    first: int = 0


@dataclass(frozen=True, slots=True)
class Vertices:
    """The vertices of a hull at one revision, and their keys if the caller asked for them."""

    counts: Counts
    vertices: Points
    keys: Keys | None

    @property
    def bytes(self) -> int:
        """The memory that they take, about."""
        text = len(self.keys.data) if isinstance(self.keys, PackedKeys) else 0
        return self.vertices.nbytes + text + (0 if self.keys is None else KEY_BYTES * len(self.keys))

    def rows(self, page: Page) -> slice:
        """The rows of a page: as many as it has room for, and at least one."""
        last = min(page.first + page.size, len(self.vertices))
        sizes = np.full(max(last - page.first, 0), POINT_BYTES + (0 if self.keys is None else KEY_BYTES))
        if isinstance(self.keys, PackedKeys):
            sizes += np.frombuffer(self.keys.lengths, np.uint8)[page.first : last]
        fitting = int(np.searchsorted(np.cumsum(sizes), PAGE_BYTES, side="right"))
        return slice(page.first, page.first + max(fitting, 1))


class _Kind(NamedTuple):
    uid: str
    revision: int
    layer: int
    named: bool


@dataclass(slots=True)
class _Kept:
    vertices: Vertices
    read_at: float


class VertexPages:
    """The vertices that callers read in pages, and did so in the last minute.

    Args:
        clock: the time.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._kept: dict[_Kind, _Kept] = {}  # the last read at the end
        self._bytes = 0
        self._forgetting: asyncio.TimerHandle | None = None

    async def read(
        self, hull: LiveHull, request: pb.GetHullRequest, run_of: Callable[[int], Run]
    ) -> tuple[Vertices, Page | None]:
        """The vertices for a request, at the revision of its page token if it has one, and the page; None for all.

        Args:
            hull: the hull.
            request: the request.
            run_of: the way to run a step that reads this many vertices.

        Raises:
            PagesForgottenError: the vertices of the page token are not kept any more.
        """
        page, layer, named = _decode_page(request), decode.decode_layer(request), request.include_keys and hull.keyed
        if page is not None and page.uid:
            return self._again(_Kind(page.uid, page.revision, layer, named), hull), page
        if named:
            counts, points, names = await hull.named_vertices(request.min_revision, layer)
            found = Vertices(counts, points, await run_of(len(points))(partial(encode.key_sequence, names)))
        else:
            found = Vertices(*await hull.vertices(request.min_revision, layer), None)
        if page is not None and found.rows(page).stop < len(found.vertices):
            self._keep(_Kind(hull.uid, found.counts.revision, layer, named), found)
        return found, page

    def _again(self, kind: _Kind, hull: LiveHull) -> Vertices:
        kept = self._kept.get(kind)
        if kept is None or kind.uid != hull.uid or self._clock.monotonic() - kept.read_at > KEPT_SECONDS:
            raise PagesForgottenError(kind.revision)
        self._keep(kind, kept.vertices)
        return kept.vertices

    def _keep(self, kind: _Kind, vertices: Vertices) -> None:
        self._drop(kind)
        self._kept[kind] = _Kept(vertices, self._clock.monotonic())
        self._bytes += vertices.bytes
        while self._bytes > KEPT_BYTES and len(self._kept) > 1:
            self._drop(next(iter(self._kept)))
        if self._forgetting is None:
            self._forgetting = asyncio.get_running_loop().call_later(KEPT_SECONDS, self._forget)

    def _drop(self, kind: _Kind) -> None:
        kept = self._kept.pop(kind, None)
        if kept is not None:
            self._bytes -= kept.vertices.bytes

    def _forget(self) -> None:
        """Drop what nobody has read for a minute, and look again later while there is more."""
        now = self._clock.monotonic()
        for kind in [kind for kind, kept in self._kept.items() if now - kept.read_at > KEPT_SECONDS]:
            self._drop(kind)
        self._forgetting = asyncio.get_running_loop().call_later(KEPT_SECONDS, self._forget) if self._kept else None


def _decode_page(request: pb.GetHullRequest) -> Page | None:
    size, token = request.vertex_page_size, request.vertex_page_token
    if size < 0:
        raise decode.InvalidFieldError("vertex_page_size", size, "must not be negative")
    if not token:
        return Page(size) if size else None
    if not size:
        raise decode.InvalidFieldError("vertex_page_size", size, "must be positive, with a vertex_page_token")
    parts = TOKEN.fullmatch(token)
    if parts is None:
        raise decode.InvalidFieldError("vertex_page_token", token, "not a page token of a call about a hull")
    return Page(size, parts["uid"], int(parts["revision"]), int(parts["first"]))


def page_token(uid: str, revision: int, first: int) -> str:
    """The token of the page that begins with this row."""
    return f"{uid}:{revision}:{first}"
