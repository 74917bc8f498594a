"""What a hull with keys or with a window holds, worked out row by row: what is put, stale or evicted, and who leaves.

A point without a key is named by its x: no two have the same.
"""

from collections.abc import Iterable
from dataclasses import dataclass

from dynhull_server.state.fences.model.records import Cause
from dynhull_server.state.records import FOREVER, NO_TIME, Contents, Expiry, HullSettings, KeyRows, PointRows

from .globe import points
from .quarantine_model import Carried, Quarantined, Verdict

Key = str | float

# What a batch did: keys that are new, known keys written, stale and skipped puts, keys removed and keys evicted.
Effect = tuple[int, int, int, int, int, int]


def accuracy_of(x: float) -> float:
    """The accuracy of every position that is put there: none of some."""
    return (0.0, 0.5, 3.0, 40.0)[int(x) % 4]


@dataclass(frozen=True, slots=True)
class Entity:
    """One point: its x, its time, when it leaves, and its y."""

    x: float
    time: int = NO_TIME
    deadline: int = FOREVER
    y: float = 0.0


class Entities:
    """The points of one hull, given by its name and settings.

    Attributes:
        held: the points there are.
        clock: the hull's clock.
        gone: why points have left in the last revision.
        quarantine: the positions held out.
    """

    def __init__(self, name: str, settings: HullSettings) -> None:
        self._name = name
        self._settings = settings
        self._window = settings.window
        self.held: dict[Key, Entity] = {}
        self.clock: int | None = None
        self.gone: dict[Key, Cause] = {}
        self.quarantine = Quarantined(settings.quarantine, ordered=settings.by_event_time)

    @property
    def follows_server(self) -> bool:
        return self._window is None or self._window.clock == "server"

    def judge(self, rows: KeyRows, clock: int | None, revision: int) -> Verdict | Carried:
        """Follow what a batch, or a request about the quarantine, does there; before `apply`."""
        if clock is not None:
            self.quarantine.leave(self._until(clock), clock)
        if len(rows.removes):
            return self.quarantine.judge(self.held, rows, revision)
        return self.quarantine.carry_out(rows)

    def apply(self, rows: KeyRows) -> Effect:
        """Put and remove keys."""
        removes = [key for key in _listed(rows.removes) if key in self.held]
        self._remove(removes, Cause.REMOVED)
        count = {"new": 0, "moved": 0, "stale": 0, "skipped": 0}
        put = points(self._name, rows.points).tolist()
        for row, key in enumerate(_listed(rows.keys)):
            time = NO_TIME if rows.times is None else int(rows.times[row])
            deadline = FOREVER if rows.deadlines is None else int(rows.deadlines[row])
            x, y = put[row]
            entity = Entity(x, time, deadline, y)
            count[self._put(key, entity, rows.condition)] += 1
        return count["new"], count["moved"], count["stale"], count["skipped"], len(removes), self._evict()

    def _remove(self, keys: Iterable[Key], why: Cause) -> None:
        self.gone = dict.fromkeys(keys, why)
        for key in keys:
            del self.held[key]

    def apply_points(self, rows: PointRows) -> Effect:
        """Insert and delete points."""
        assert rows.times is not None  # there is a window
        deletes = [x for x, _ in points(self._name, rows.deletes).tolist() if x in self.held]
        self._remove(deletes, Cause.REMOVED)
        for (x, y), time in zip(points(self._name, rows.inserts).tolist(), rows.times.tolist(), strict=True):
            self.held[x] = Entity(x, time, y=y)
        return len(rows.inserts), 0, 0, 0, len(deletes), self._evict()

    def _put(self, key: Key, entity: Entity, condition: str | None) -> str:
        before = self.held.get(key)
        if condition == ("present" if before is None else "absent"):
            return "skipped"
        if self._settings.by_event_time and before is not None and entity.time < before.time:
            return "stale"
        self.held[key] = entity
        return "new" if before is None else "moved"

    def _evict(self) -> int:
        most = self._window.max_points if self._window is not None else 0
        keyed = self._settings.identity != "multiset"  # otherwise the first to come leave first
        oldest = sorted(self.held, key=lambda key: (self.held[key].time, key if keyed else 0))  # type: ignore[arg-type, return-value]
        leaving = oldest[: len(oldest) - most] if most else []
        for key in leaving:
            del self.held[key]
            self.gone[key] = Cause.EXPIRED
        return len(leaving)

    def expire(self, rows: Expiry, clock: int) -> bool:
        """Let those leave that are too old, or whose time has come. Whether they are as many as was said."""
        leaving = self.overdue(clock, rows.until)
        self._remove(leaving, Cause.EXPIRED)
        self.quarantine.leave(rows.until, clock)
        return len(leaving) == rows.points > 0

    def overdue(self, clock: int, until: int | None = None) -> list[Key]:
        """Who has to have left when the hull's clock is `clock`."""
        if until is None:
            until = self._until(clock)
        return [
            key
            for key, entity in self.held.items()
            if (until is not None and NO_TIME < entity.time <= until) or entity.deadline <= clock
        ]

    def _until(self, clock: int) -> int | None:
        """The greatest time that is too old."""
        return clock - self._window.max_age if self._window is not None and self._window.max_age else None


def loaded(name: str, contents: Contents) -> dict[Key, Entity]:
    """The points of a snapshot."""
    xs, ys, n = *points(name, contents.points).T.tolist(), len(contents)
    keys = xs if contents.keys is None else _listed(contents.keys)
    times = [NO_TIME] * n if contents.times is None else contents.times.tolist()
    deadlines = [FOREVER] * n if contents.deadlines is None else contents.deadlines.tolist()
    return dict(zip(keys, map(Entity, xs, times, deadlines, ys), strict=True))


def _listed(keys: object) -> list[Key]:
    return [key if isinstance(key, str) else int(key) for key in keys]  # type: ignore[attr-defined]
