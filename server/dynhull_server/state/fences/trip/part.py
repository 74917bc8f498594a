"""The part of a trip that concerns fences: called where hulls have changed, and for requests about fences."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import assert_never

from ...alarms.rule import unmarked
from ...alarms.status import AlarmStatus, status_of
from ...batch import Applied
from ...changes import Change
from ...contents.keyed import Keyed
from ...errors import (
    AlarmNotRaisedError,
    FenceNotFoundError,
    HullFencedError,
    HullUnsuitableError,
    LimitExceededError,
)
from ...hull import Hull
from ...leg import Leg
from ...records import NO_TIME, HullSettings
from ...requests import Request
from ..events.block import AppendEvents, EventBlock, block_of, joined
from ..events.sequences import Told
from ..index.keys_changed import KeysChanged, of_batch, of_expiry
from ..index.line import Line
from ..index.subjects import Subjects
from ..model.fence import Fence
from ..model.records import Cause, KeptFence, Key
from ..model.requests import (
    STRUCTURAL,
    Acknowledge,
    AcknowledgeAlarm,
    AnyFenceRequest,
    CreateFence,
    DeleteConsumer,
    DeleteFence,
    MuteAlarm,
    PassTime,
    ReadFence,
    ReplaceFence,
    TrimEvents,
)
from .alarms import deleted as clear_deleted
from .alarms import look, put_standing
from .comparison import EXPIRY, Comparison, Ground
from .consumers import drop_consumer, drop_events, put_consumer
from .deadlines import pass_time
from .definition import Definition
from .expected import follow
from .leg import FenceLeg


class FencePart:
    """What a trip does to fences: its batches, and the events that follow from them, are committed together.

    Args:
        ground: what the trip begins with.
        requests: its requests.

    Attributes:
        structural: whether it changes which hulls share a queue.
        creates: the number of fences that it creates, at most.
        events: all events that it has made, also the last ones of fences that it deletes; None for none.
        examined: the numbers of the fences that are examined after a failure.
        room: how many more hulls alarms may watch, which is reserved for it.
    """

    __slots__ = (
        "_comparison",
        "_definition",
        "_ended",
        "_ground",
        "_watching",
        "creates",
        "events",
        "examined",
        "room",
        "structural",
    )

    def __init__(self, ground: Ground, requests: Sequence[Request]) -> None:
        self.structural = bool(requests) and isinstance(requests[0], STRUCTURAL)
        self.creates = len(requests) if requests and isinstance(requests[0], CreateFence) else 0
        self.events: EventBlock | None = None
        self.examined: list[int] = []
        self.room = ground.room
        self._ground = ground
        self._comparison = Comparison(ground)
        self._definition = Definition(ground, self._comparison)
        self._ended: dict[str, set[Key]] = {}
        self._watching: dict[str, int] = {}  # the alarms at new hulls

    @property
    def lines(self) -> Sequence[Line]:
        """The lines of the queues of the trip."""
        return self._ground.lines

    @property
    def legs(self) -> Mapping[int, FenceLeg]:
        """The fences that it changes otherwise than by events of crossings, by number."""
        return self._comparison.legs

    @property
    def crossed(self) -> Told | None:
        """What it has said of fences in events of crossings."""
        return self._comparison.log.told

    @property
    def left(self) -> Sequence[CreateFence]:
        """The requests that are left for a later trip."""
        return self._definition.left

    @property
    def applied(self) -> bool:
        """Whether a fence has changed in memory, so that a failed commit needs an examination."""
        return self._comparison.applied

    @property
    def torn(self) -> bool:
        """Whether crossings may have been lost."""
        return self._comparison.torn

    @property
    def weight(self) -> int:
        """The number of subjects that it may concern beside the rows of the requests."""
        return sum([line.weight(name) for line in self.lines for name in self._ground.hulls])

    # Changes of hulls

    def admit(self, hull: Hull) -> None:
        """Compare the keys of a new hull, and watch it.

        Raises:
            HullUnsuitableError: it is divided.
            LimitExceededError: alarms watch too many hulls with it.
        """
        if hull.divided:
            reason = "begins with the prefix of a fence, which does not compare a hull that is divided among shards"
            raise HullUnsuitableError(hull.name, reason, field="config.shards")
        watching = sum(len(line.watching_new(hull)) for line in self.lines)
        if watching and sum(self._watching.values()) + watching > self._ground.room:
            raise LimitExceededError("max_alarm_hulls", self._ground.limits.max_alarm_hulls)
        self._watching[hull.name] = watching
        for line in self.lines:
            line.admit(hull)

    def settled(self, name: str, settings: HullSettings) -> HullSettings:
        """The settings of a new hull, with the centre that fences over its prefix give it."""
        for line in self.lines:
            settings = line.settled(name, settings)
        return settings

    def created(self, hull: Hull, now: int) -> None:
        """Raise alarms for a new hull, which is empty."""
        for line in self.lines:
            for fence, watched in line.watching([hull.name]):
                self._comparison.applied = True
                look(self._comparison.leg(fence), watched, Cause.APPEARED, now)

    def wrote(self, leg: Leg, hull: Hull, applied: Applied | None, now: int) -> None:
        """Make the events of a batch; None where it was refused."""
        if applied is None:
            if hull is not leg.after:  # it was not created after all
                self._dismiss(hull.name)
        elif not applied.duplicate:
            name, changed = hull.row.name, {}
            if self._ground.tallies.ruled or self._comparison.legs:  # nobody else asks what a batch has done to keys
                for line in self.lines:
                    if name in line.subjects:
                        changed[name] = of_batch(hull, applied, leg.records or ())
            self._comparison.compare([hull], now, None, changed)

    def expired(self, hull: Hull, now: int) -> None:
        """Make the events of points that have left."""
        self._comparison.compare([hull], now, EXPIRY, {hull.name: of_expiry(hull)})

    def expired_before(self, hull: Hull) -> None:
        """Take note of points that have left one of several hulls before its batch."""
        contents = hull.state.contents
        if isinstance(contents, Keyed):
            self._ended[hull.name] = set(contents.ended)

    def wrote_together(self, legs: Sequence[Leg], applied: Sequence[Applied], now: int) -> None:
        """Make the events of a batch over several hulls."""
        ended, self._ended = self._ended, {}
        hulls = [leg.after for leg in legs if leg.after is not None]
        changed = {
            leg.name: of_batch(hull, each, leg.records or (), ended.get(leg.name, frozenset()))
            for leg, hull, each in zip(legs, hulls, applied, strict=True)
            if not each.duplicate
        }
        self._comparison.compare(hulls, now, None, changed)

    def repeated(self, changed: Mapping[Hull, KeysChanged], now: int, *, expiry: bool) -> None:
        """Make the events of revisions that were applied again; `expiry` where they are points that have left."""
        found = {hull.name: each for hull, each in changed.items()}
        self._comparison.compare(list(changed), now, EXPIRY if expiry else None, found)

    def recentered(self, hull: Hull, now: int) -> None:
        """Compare a hull that has another centre, by which a measure may be rounded otherwise."""
        for line in self.lines:
            for fence, watched in line.watching([hull.name]):
                watched.doubt()
                if watched.touched(now):
                    cause = Cause.CHANGED if watched.hull.name == hull.name else Cause.AREA
                    look(self._comparison.leg(fence), watched, cause, now)

    def require_free(self, name: str, *, recenters: bool = False) -> None:
        """Raise HullFencedError if a fence or an alarm names the hull; if it `recenters`, if a fence depends on it."""
        for line in self.lines:
            for fence in line.fences.values():
                config, is_fence = fence.row.config, fence.watched is None
                depends = name == config.area_hull or (config.kind != "prefix" and name == config.subjects)
                if recenters:
                    depends = is_fence and (depends or name in fence.subjects)
                if depends:
                    raise HullFencedError(name, unmarked(fence.name), "fence" if is_fence else "alarm")

    def hull_deleted(self, name: str, now: int) -> None:
        """The keys of a deleted hull leave the fences with its prefix, and alarms are cleared for it."""
        for fence, watched in [each for line in self.lines for each in line.watching([name])]:
            self._comparison.applied = True
            clear_deleted(self._comparison.leg(fence), watched, now)
        for subjects in [line.subjects[name] for line in self.lines if name in line.subjects]:
            for fence in subjects.fences.values():
                leg = self._comparison.leg(fence)
                keys = fence.keys_inside(subjects)
                for key in () if fence.delays is None else list(fence.delays.of(name)):
                    leg.put_delay((name, key), None)
                    self._comparison.applied = True
                leg.left(subjects, keys, int(Cause.REMOVED), now)

    # Requests about fences

    def do(self, request: AnyFenceRequest) -> object:
        """Run a request about a fence. Returns its result."""
        if isinstance(request, CreateFence):
            return self._definition.create(request)
        fence, comparison = self._ground.fences[request.name], self._comparison
        if fence is None:
            if isinstance(request, TrimEvents):  # the deletion has overtaken it
                return None
            if isinstance(request, PassTime):
                return 0
            raise FenceNotFoundError(request.name)
        match request:
            case ReadFence():
                leg, made = self.legs.get(fence.number), comparison.log.events(fence.number)
                return request.function(fence, made if leg is None else [*made, *leg.events])
            case ReplaceFence():
                return self._definition.replace(request, fence)
            case DeleteFence():
                self._definition.delete(request, fence)
            case Acknowledge():
                return put_consumer(request, comparison.leg(fence), self._ground.limits.max_fence_consumers)
            case DeleteConsumer():
                drop_consumer(request, comparison.leg(fence))
            case PassTime():
                pass_time(request, fence, comparison)
                return 0
            case TrimEvents():
                drop_events(request, comparison.leg(fence))
            case AcknowledgeAlarm() | MuteAlarm():
                return self._put_standing(request, fence)
            case _:
                assert_never(request)
        return None

    def _put_standing(self, request: AcknowledgeAlarm | MuteAlarm, fence: Fence) -> AlarmStatus:
        name, hull = unmarked(fence.name), request.hull
        watched = None if fence.watched is None else fence.watched.of.get(hull)
        if isinstance(request, AcknowledgeAlarm) and (watched is None or not watched.raised):
            raise AlarmNotRaisedError(name, hull)
        if watched is None:
            raise HullUnsuitableError(hull, f"is not one that the alarm {name!r} watches", field="hull")
        leg = self._comparison.leg(fence)
        if isinstance(request, MuteAlarm):
            put_standing(leg, watched, muted=request.until if request.until > request.time else NO_TIME)
        else:
            put_standing(leg, watched, acknowledged=leg.time(request.time))
        self._comparison.applied = True
        return status_of(watched, request.time)

    # After the requests

    def settle(self, requests: list[Request]) -> None:
        """Number the events, and remove the requests that are left for a later trip."""
        legs = self._comparison.legs.values()
        for leg in legs:
            follow(leg, leg.time(NO_TIME))
        self._comparison.log.settle()
        self.events = self._block(legs)
        if self.left:
            del requests[-len(self.left) :]

    def changes(self) -> Iterator[Change]:
        """The changes to commit, after those of the hulls."""
        legs, stored = self._comparison.legs.values(), self.events
        if any(leg.deleted for leg in legs):
            stored = self._block([leg for leg in legs if not leg.deleted])
        for leg in legs:
            yield from leg.settings()
        if stored is not None:
            yield AppendEvents(stored)
        for leg in legs:
            yield from leg.changes()

    def _block(self, legs: Iterable[FenceLeg]) -> EventBlock | None:
        """The events of crossings, then those of these legs; None for none."""
        crossed, of_legs = self._comparison.log.block(), {leg.fence.number: leg.events for leg in legs if leg.events}
        if not of_legs:
            return crossed
        found = [crossed] if crossed is not None else []
        return joined([*found, block_of(of_legs)])

    def landed(self, fences: list[KeptFence | None]) -> bool:
        """Whether its changes were committed, given what the storage has of the examined fences."""
        found, crossed = dict(zip(self.examined, fences, strict=True)), self.crossed
        lasts = {} if crossed is None else dict(zip(crossed.fences.tolist(), crossed.lasts.tolist(), strict=True))
        kept = ((found[number], last) for number, last in lasts.items() if number not in self.legs)
        return all(leg.landed(found[number]) for number, leg in self.legs.items()) and all(
            each is not None and each.last == last for each, last in kept
        )

    def touched(self) -> dict[str, Subjects]:
        """The hulls by name whose subjects may differ from what the storage has, if the trip is not committed.

        An examination reads all hulls of the trip anew, also those that it has not changed.
        """
        touched: dict[str, Subjects] = {}
        for line in self.lines:
            for name in self._ground.hulls:
                if name in line.subjects:
                    touched[name] = line.subjects[name]
                if name in line.areas:
                    for fence in line.areas[name].fences.values():
                        touched |= fence.subjects
        for leg in self.legs.values():
            if not leg.created:
                touched |= leg.fence.subjects
        for hull in self._ground.hulls.values():
            if hull.before is None:  # a hull that is created has none in the storage
                touched.pop(hull.name, None)
        return touched

    def pairs(self) -> set[int]:
        """The numbers of the fences that compare its hulls as wholes, and of the alarms at them."""
        return {
            fence.number
            for line in self.lines
            for name in self._ground.hulls
            for fence in (*line.pairs.get(name, ()), *line.alarms.get(name, ()))
        }

    def dismiss_deleted(self) -> None:
        """Forget the subjects of hulls that it has deleted."""
        for hull in self._ground.hulls.values():
            if hull.before is not None and hull.after is None:
                self._dismiss(hull.name)

    def undo_created(self) -> None:
        """Forget fences and hulls that were not created after all."""
        for hull in self._ground.hulls.values():
            if hull.before is None:
                self._dismiss(hull.name)
        self._definition.undo()

    def _dismiss(self, name: str) -> None:
        self._watching.pop(name, None)
        for line in self.lines:
            line.dismiss(name)
