"""A shard: the points that belong to it, their hull, and its log."""

from dataclasses import dataclass
from itertools import compress
from typing import Any, assert_never

import numpy as np
import numpy.typing as npt

from dynhull import convex_hull
from dynhull.static import chan
from dynhull.static.trace import Round, Rounds
from dynhull_server.state.batch import NO_POINTS
from dynhull_server.state.contents import replayed
from dynhull_server.state.contents.key_rows import keys_match
from dynhull_server.state.contents.keyed import Keyed
from dynhull_server.state.contents.live import LiveContents
from dynhull_server.state.errors import RefusedError
from dynhull_server.state.numbers import as_numbers
from dynhull_server.state.records import Contents, HullSettings, Record
from dynhull_server.state.sample import sample

from .inverse import Inverse, inverse_of
from .logs import ShardLog
from .messages import (
    AllOf,
    Answered,
    Apply,
    Ask,
    Closed,
    Corners,
    CountOf,
    Done,
    Effect,
    FoundOf,
    Open,
    Opened,
    PositionsOf,
    Question,
    Recompute,
    Recomputed,
    Reply,
    Request,
    SampleOf,
    ShardTotals,
    SlotsOf,
    StaticHull,
    Step,
    Undo,
    Undone,
    VertexChange,
)
from .moving import Dealt

Rows = npt.NDArray[np.bool_]


@dataclass(slots=True)
class _Uncertain:
    """A step that the root may undo.

    Attributes:
        number: its number.
        before: the number of the step before it.
        corners: the vertices before it.
        inverse: how to undo it; None for a step that the root will not undo.
    """

    number: int
    before: int
    corners: Corners
    inverse: Inverse | None


class Shard:
    """One shard of a hull. A new one knows nothing but its log, and waits for the root to open it.

    Args:
        settings: the settings of the hull.
        log: its log.
    """

    def __init__(self, settings: HullSettings, log: ShardLog) -> None:
        self._settings = settings
        self._log = log
        self._contents: LiveContents | None = None
        self._epoch = self._ticket = 0
        self._reply: Reply | None = None
        self._number = 0
        self._uncertain: list[_Uncertain] = []
        self._corners = Corners(NO_POINTS, None)
        self._corners_as_of = -1
        self._dealt: Dealt | None = None  # while the root asks for one part after the other

    def receive(self, message: Request) -> Reply | None:
        """Handle a message of the root. Returns the reply, None for a message that is too late.

        Raises:
            Exception: memory or the log failed in the middle: the shard must be replaced by a new one.
        """
        if message.epoch < self._log.epoch:
            return None
        known = self._contents is not None and message.epoch == self._epoch
        if known and message.ticket <= self._ticket:
            return self._reply if message.ticket == self._ticket else None
        if not known and (not isinstance(message, Open) or message.epoch == self._log.epoch):
            return Closed(message.epoch, message.ticket)
        reply = self._handle(message)
        self._epoch, self._ticket, self._reply = message.epoch, message.ticket, reply
        return reply

    def settled(self, message: Request) -> LiveContents | None:
        """The contents, if a new message says that all of them are decided; ask before it is handled."""
        known = self._contents is not None and message.epoch == self._epoch == self._log.epoch
        if known and message.ticket > self._ticket and isinstance(message, Apply | Ask):
            return self._contents
        return None

    def _handle(self, message: Request) -> Reply:
        if not (isinstance(message, Ask) and isinstance(message.question, SlotsOf)):
            self._dealt = None
        match message:
            case Open():
                return self._open(message)
            case Apply():
                return self._apply(message)
            case Undo():
                return self._undo(message)
            case Ask():
                return Answered(message.epoch, message.ticket, self._answer(message.question))
        assert_never(message)

    def _open(self, message: Open) -> Opened:
        self._log.begin(message.epoch, message.decided)
        contents = self._contents
        if contents is None or self._number > message.decided:
            kept, self._number = self._log.read()
            contents = replayed(kept, self._settings)
        self._contents, self._uncertain = contents, []
        self._corners, self._corners_as_of = _corners(contents), contents.hull.changes
        return Opened(message.epoch, message.ticket, self._number, _totals(contents), self._corners)

    def _apply(self, message: Apply) -> Done:
        self._uncertain = []
        effects: list[Effect] = []
        log: list[tuple[int, list[Record]]] = []
        for step in message.steps:
            records: list[Record] = []
            effects.append(self._step(step, records))
            if effects[-1].error is not None:
                break
            if records:
                log.append((step.number, records))
        if log:
            self._log.add(log)
        return Done(message.epoch, message.ticket, tuple(effects))

    def _step(self, step: Step, records: list[Record]) -> Effect:
        contents, part, before = self._opened, step.part, self._corners
        inverse = inverse_of(part, contents, self._settings) if step.undoable else None
        expired, applied, left, changed = 0, None, None, None
        try:
            if step.clock is not None:
                if part is not None:
                    contents.check(part)  # a refused batch makes no points leave
                expiry = contents.expire(step.clock)
                if expiry is not None:
                    expired, left = expiry.points, self._follow(contents)
                    records.append(Record(step.number, expiry, clock=contents.clock, cause="expiry"))
            if part is not None:
                applied = contents.apply(part, step.number)
                changed = self._follow(contents)
                rows = contents.rows(part, applied)
                records.append(Record(step.number, rows, clock=contents.clock, cause="batch"))
        except RefusedError as error:
            return Effect(step.number, _totals(contents), error=error)
        if records:
            self._uncertain.append(_Uncertain(step.number, self._number, before, inverse))
            self._number = step.number
        return Effect(step.number, _totals(contents), expired, left, applied, changed)

    def _undo(self, message: Undo) -> Undone:
        self._log.drop(message.number)
        while self._uncertain and self._uncertain[-1].number >= message.number:
            last = self._uncertain.pop()
            assert last.inverse is not None  # the root undoes what it has called undoable
            self._contents = last.inverse()
            self._number, self._corners = last.before, last.corners
            self._corners_as_of = self._contents.hull.changes
        return Undone(message.epoch, message.ticket)

    def _follow(self, contents: LiveContents) -> VertexChange | None:
        """How the vertices have changed since this was last called. O(1) where they have not and have no keys."""
        if not isinstance(contents, Keyed) and contents.hull.changes == self._corners_as_of:
            return None
        before, self._corners = self._corners, _corners(contents)
        self._corners_as_of = contents.hull.changes
        return _difference(before, self._corners)

    def _answer(self, question: Question) -> Any:
        contents = self._opened
        match question:
            case SampleOf(size):
                points = contents.hull.points()
                return points if len(points) <= size else sample(points, size)
            case CountOf(points):
                return contents.hull.count_many(points)
            case PositionsOf(keys):
                assert isinstance(contents, Keyed)  # the root has checked it
                return contents.find(keys).points
            case StaticHull():
                return convex_hull(contents.hull.points())
            case FoundOf(keys):
                assert isinstance(contents, Keyed)  # likewise
                return contents.find(keys)
            case AllOf():
                return contents.stored()
            case Recompute():
                return _recomputed(contents)
            case SlotsOf(first, end):
                return self._slots(contents, first, end)
        assert_never(question)

    def _slots(self, contents: LiveContents, first: int, end: int) -> Contents:
        if self._dealt is None:
            self._dealt = Dealt(contents.stored())
        return self._dealt.between(first, end)

    @property
    def _opened(self) -> LiveContents:
        assert self._contents is not None  # `receive` has seen to it
        return self._contents


def _recomputed(contents: LiveContents) -> Recomputed:
    points, trace = contents.hull.points(), Rounds()
    vertices = chan(points, trace=trace)
    whole = not isinstance(contents, Keyed) or keys_match(contents.stored(), points)
    return Recomputed(len(points), vertices, tuple(each for each in trace if isinstance(each, Round)), whole)


def _totals(contents: LiveContents) -> ShardTotals:
    return ShardTotals(len(contents.hull), contents.hull.distinct, contents.due)


def _corners(contents: LiveContents) -> Corners:
    keys = tuple(contents.hull.vertex_keys()) if isinstance(contents, Keyed) else None
    return Corners(contents.hull.vertices().copy(), keys)


def _difference(before: Corners, after: Corners) -> VertexChange | None:
    if before.keys is None or after.keys is None:
        old, new = as_numbers(before.points), as_numbers(after.points)
        gone = np.isin(old, new, assume_unique=True, invert=True)
        come = np.isin(new, old, assume_unique=True, invert=True)
    else:
        named = [set(zip(map(tuple, each.points.tolist()), each.keys or (), strict=True)) for each in (before, after)]
        gone, come = _missing_from(named[1], before), _missing_from(named[0], after)
    if not gone.any() and not come.any():
        return None
    return VertexChange(_selected(before, gone), _selected(after, come))


def _missing_from(named: set[Any], corners: Corners) -> Rows:
    pairs = zip(map(tuple, corners.points.tolist()), corners.keys or (), strict=True)
    return np.array([pair not in named for pair in pairs], np.bool_)


def _selected(corners: Corners, which: Rows) -> Corners:
    keys = None if corners.keys is None else tuple(compress(corners.keys, which.tolist()))
    return Corners(corners.points[which], keys)
