"""Where requests wait: the queue of each name, and which names share one.

Each name has a queue. A request to several hulls waits in all of their queues, and begins when it is the first in each
of them. It enters the queues in one step, so any two such requests are in the same order wherever they meet, and there
is no deadlock.

The hulls that a fence depends on share one queue, so that what a change of one means for the fence is known before the
next change of any. Creating and deleting a fence joins and parts queues, in a step in which none of them has a trip.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any

from .fences.index.components import SPANNING, components, depends_on, merged
from .fences.index.line import Line
from .fences.model.fence import Fence
from .fences.model.requests import PREFIX, CreateFence, FenceRequest, ReplaceFence
from .fences.trip.part import FencePart
from .hull import Hull
from .registry import Registry
from .requests import ReadHull, ReadTogether, Request, WriteTogether
from .trip import Trip


class Queue:
    """The work of one name, or of all hulls and fences of a line.

    Attributes:
        name: the name, or one of those of the line.
        hull: the committed hull of that name, or None. None for a line.
        line: the fences of several hulls that share the queue, or None.
        guests: names that begin with the prefix of a fence, and have no hull so far; None for none.
        trip: the trip in progress, or None.
        waiting: the requests for later trips. While there is no trip, the first one waits in other queues, too.
    """

    __slots__ = ("guests", "hull", "line", "name", "trip", "waiting")

    def __init__(self, name: str, hull: Hull | None = None, line: Line | None = None) -> None:
        self.name = name
        self.hull = hull
        self.line = line
        self.guests: set[str] | None = None
        self.trip: Trip | None = None
        self.waiting: list[Request] = []

    @property
    def ill(self) -> Exception | None:
        """Why the storage cannot be read after a failed commit, None unless that is so."""
        return None if self.trip is None else self.trip.ill


class Queues:
    """The queues of all names.

    Args:
        registry: the hulls and fences that are committed.

    Attributes:
        get: the queue of a name, None if it has neither a hull nor work.
    """

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        self._queues: dict[str, Queue] = {}
        self.get: Callable[[str], Queue | None] = self._queues.get
        # The prefixes of fences, by the names of their queues; also of those that are being created.
        self._prefixes: dict[str, str] = {}
        self._first_order = self._last_order = 0

    def __iter__(self) -> Iterator[Queue]:
        """The queues, by name; one that names share comes several times."""
        return iter(self._queues.values())

    def add(self, hull: Hull) -> None:
        """Add the queue of a hull."""
        self._queues[hull.name] = Queue(hull.name, hull)

    def of(self, name: str) -> Queue:
        """The queue of a name, a new one if there is none."""
        queue = self._queues.get(name)
        if queue is None:
            queue = self._queues[name] = self._line_queue(name) or Queue(name)
        return queue

    def at(self, names: Iterable[str]) -> list[Queue]:
        """The queues of these names."""
        return list(dict.fromkeys(self._queues[name] for name in names))

    def _line_queue(self, name: str) -> Queue | None:
        """The queue of a fence whose prefix the name of a new hull has; None if there is none."""
        for key, prefix in self._prefixes.items():
            if name.startswith(prefix) and not name.startswith(PREFIX):
                queue = self._queues[key]
                queue.guests = (queue.guests or set()) | {name}
                return queue
        return None

    def add_fences(self, fences: Sequence[Fence]) -> None:
        """Add the queues of fences that there are, and let those of their hulls be one. O(hulls), if there are any."""
        if not fences:
            return
        for fence in fences:
            if fence.row.config.kind == "prefix":
                self.reserve_prefix(fence.name, fence.row.config.subjects)
        self.regroup([*self, *(self.of(PREFIX + fence.name) for fence in fences)], fences)

    def put(self, request: SPANNING, names: Iterable[str]) -> list[Queue]:
        """Let a request wait in the queues of some names. Returns the queues."""
        found = list(dict.fromkeys(self.of(name) for name in names))
        self._last_order += 1
        request.order = self._last_order
        for queue in found:
            queue.waiting.append(request)
        return found

    def remove(self, request: SPANNING) -> list[Queue]:
        """Remove a request from the queues where it waits. Returns these queues: they may go on without it."""
        queues = dict.fromkeys(self._queues[name] for name in names_of(request) if name in self._queues)
        left = [queue for queue in queues if request in queue.waiting]
        for queue in left:
            queue.waiting.remove(request)
        return left

    def involved(self, request: FenceRequest) -> tuple[str, ...]:
        """The names of the queues of a request about a fence."""
        names = [PREFIX + request.name]
        if isinstance(request, CreateFence | ReplaceFence):
            config = request.config
            if config.area_hull is not None:
                names.append(config.area_hull)
            if config.kind != "prefix":
                names.append(config.subjects)
            elif isinstance(request, CreateFence):
                names += self._overlapping(config.subjects)
        return tuple(names)

    def _overlapping(self, prefix: str) -> list[str]:
        """The names of queues that a fence with this prefix joins: of hulls with it, and of fences that meet it."""
        meets = [name for name, each in self._prefixes.items() if each.startswith(prefix) or prefix.startswith(each)]
        return meets + [name for name in self._queues if name.startswith(prefix) and not name.startswith(PREFIX)]

    def complete(self, request: CreateFence) -> list[Queue]:
        """Let a request wait in queues that it joins and that are newer. Returns these queues.

        Once it is the first in its older queues, it becomes the first there: so it is everywhere in front of requests
        that wait behind it anywhere.
        """
        if not all(queue.waiting and queue.waiting[0] is request for queue in self.at(request.names)):
            return []
        names = [name for name in self._overlapping(request.config.subjects) if name not in request.names]
        queues = [queue for queue in self.at(names) if request not in queue.waiting]
        if queues:
            self._first_order -= 1
            request.order = self._first_order
        for queue in queues:
            queue.waiting.insert(0, request)
        request.names += tuple(names)
        return queues

    def rest(self, queue: Queue) -> None:
        """Remove the queue of a name that has neither a hull nor work."""
        if queue.hull is not None or queue.trip is not None or queue.waiting:
            return
        if queue.line is not None:
            if queue.guests is not None:
                self._dismiss_guests(queue, queue.line, queue.guests)
            return
        if self._queues.get(queue.name) is queue:  # it has not become part of a line
            del self._queues[queue.name]

    def _dismiss_guests(self, queue: Queue, line: Line, guests: set[str]) -> None:
        """Forget the names without a hull; the others stay."""
        queue.guests = None
        for name in guests:
            if name in self._registry.hulls:
                line.names[name] = None
            else:
                line.names.pop(name, None)
                del self._queues[name]

    # Names that fences join

    def reserve_prefix(self, fence: str, prefix: str) -> None:
        """Let hulls that may come with a prefix belong to the queue of a fence, one that is being created perhaps."""
        self._prefixes.setdefault(PREFIX + fence, prefix)

    def free_prefix(self, fence: str) -> None:
        """Forget the prefix of a fence that is deleted."""
        self._prefixes.pop(PREFIX + fence, None)

    def end_creation(self, trip: Trip, part: FencePart) -> None:
        """Forget the prefix of a fence that was not created after all."""
        for key in [key for key in self._prefixes if key.removeprefix(PREFIX) not in self._registry.fences]:
            if any(queue.name == key for queue in trip.queues):
                del self._prefixes[key]
                self.renew(trip, part)

    def renew(self, trip: Trip, part: FencePart) -> None:
        """Join and part the queues of a trip as the fences demand that are left."""
        fences = {fence.name: fence for line in part.lines for fence in line.fences.values()}
        trip.queues = self.regroup(trip.queues, fences.values(), trip)

    def rejoin(self, trip: Trip, part: FencePart, *, moved: bool) -> None:
        """Join and part queues after fences were created or deleted, or have moved to the area of another hull."""
        created = [leg.fence for leg in part.legs.values() if leg.created]
        deleted = [leg.fence for leg in part.legs.values() if leg.deleted]
        if not (created or deleted or moved):
            return
        home = max(
            (queue for queue in trip.queues if queue.line is not None),
            key=lambda queue: len(queue.line.fences),
            default=None,
        )
        if home is not None and home.line is not None and not moved:
            if created and all(fence.row.config.kind != "prefix" for fence in created):
                self._join(trip, home, home.line, created)
                return
            if not created and len(deleted) < len(home.line.fences) and all(map(_is_leaf, deleted)):
                self._part(trip, home, home.line, deleted)
                return
        fences = {fence.name: fence for line in part.lines for fence in line.fences.values() if not fence.ended}
        fences |= {fence.name: fence for fence in created}
        trip.queues = self.regroup(trip.queues, fences.values(), trip)

    def _join(self, trip: Trip, home: Queue, line: Line, fences: list[Fence]) -> None:
        """Let the queues of the hulls that new fences depend on, all the same ones, become part of a line.

        O(names and fences of the other queues, and requests).
        """
        joined = self.at(name for fence in fences for name in (PREFIX + fence.name, *depends_on(fence)))
        waiting = merged([queue.waiting for queue in joined])
        for queue in joined:
            queue.waiting = []
            if queue is home:
                continue
            names = dict.fromkeys([queue.name]) if queue.line is None else queue.line.names
            for fence in () if queue.line is None else queue.line.fences.values():
                line.add(fence)
            if queue.guests is not None:
                home.guests = (home.guests or set()) | queue.guests
            line.names |= names
            self._queues |= dict.fromkeys((*names, *(queue.guests or ())), home)
        for fence in fences:
            line.add(fence)
        home.waiting = waiting
        trip.queues = [home, *(queue for queue in trip.queues if queue not in joined)]

    def _part(self, trip: Trip, home: Queue, line: Line, fences: list[Fence]) -> None:
        """Take deleted fences from a line that stays together without them. O(fences and requests)."""
        parted = []
        for fence in fences:
            line.remove(fence)
            name = PREFIX + fence.name
            del line.names[name]
            queue = self._queues[name] = Queue(name)
            queue.trip = trip
            parted.append(queue)
        home.name = next(iter(line.names))
        trip.queues = [home, *parted]
        waiting, home.waiting = home.waiting, []
        for request in waiting:
            for queue in self.at(names_of(request)):
                if queue in trip.queues:  # in others it has never ceased to wait
                    queue.waiting.append(request)

    def regroup(self, queues: list[Queue], fences: Iterable[Fence], trip: Trip | None = None) -> list[Queue]:
        """Make queues of these ones: one for all names that fences join, one for each other name.

        None of the queues has another trip. Their requests keep their order.
        """
        names = dict.fromkeys(
            name
            for queue in queues
            for name in (*([queue.name] if queue.line is None else queue.line.names), *(queue.guests or ()))
        )
        waiting = merged([queue.waiting for queue in queues])
        for queue in queues:
            queue.waiting = []
        made: list[Queue] = []
        for group, of_group in components(list(names), fences):
            if of_group:
                queue = Queue(PREFIX + of_group[0].name, line=Line(of_group, group))
                guests = {name for name in group if name not in self._registry.hulls and not name.startswith(PREFIX)}
                queue.guests = guests or None
            else:
                (name,) = group
                queue = Queue(name, self._registry.hulls.get(name))
            queue.trip = trip
            made.append(queue)
            self._queues |= dict.fromkeys(group, queue)
        for request in waiting:
            for queue in self.at(names_of(request)):
                if queue in made:  # in others it has never ceased to wait
                    queue.waiting.append(request)
        return made

    def check(self) -> None:
        """Raise AssertionError if names share queues otherwise than the fences demand. No trip is in progress.

        O(hulls and fences).
        """
        names = [*self._registry.hulls, *(PREFIX + name for name in self._registry.fences)]
        for group, fences in components(names, self._registry.fences.values()):
            queue = self._queues[group[0]]
            assert all(self._queues[name] is queue for name in group), group
            if queue.line is None:
                assert not fences, group
                assert queue.name == group[0], group
                continue
            line, anew = queue.line, Line(fences, group)
            assert queue.name in line.names, group
            assert anew.names.keys() <= line.names.keys(), group
            assert all(self._queues.get(name) is queue for name in line.names), line.names
            assert line.fences == anew.fences, group
            assert line.subjects == anew.subjects, group
            assert {name: set(each) for name, each in line.pairs.items() if each} == {
                name: set(each) for name, each in anew.pairs.items()
            }, group
            assert {name: each.fences for name, each in line.areas.items()} == {
                name: each.fences for name, each in anew.areas.items()
            }, group


def _is_leaf(fence: Fence) -> bool:
    """Whether a fence joins no hulls: its line stays together without it."""
    return fence.row.config.kind != "prefix" and len(set(depends_on(fence))) == 1


def names_of(request: Any) -> Sequence[str]:
    """The names that a request concerns."""
    match request:
        case FenceRequest():
            names: Sequence[str] = request.names
            return names
        case WriteTogether() | ReadTogether():
            return [part.name for part in request.parts]
        case ReadHull():
            return [request.hull.name]
        case _:
            return [request.name]
