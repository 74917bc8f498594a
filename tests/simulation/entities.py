"""What a keyed hull holds, worked out row by row: whom a batch puts, what is stale, and who leaves when."""

from dataclasses import dataclass

from dynhull_server.state.records import FOREVER, NO_TIME, Expiry, HullSettings, KeyRows

Key = str | int

# What a batch did: keys that are new, known keys written, stale and skipped puts, keys removed and keys evicted.
Effect = tuple[int, int, int, int, int, int]


@dataclass(frozen=True, slots=True)
class Entity:
    """One key: its x, its time, and when it leaves."""

    x: float
    time: int = NO_TIME
    deadline: int = FOREVER


class Entities:
    """The keys of one hull.

    Attributes:
        held: the keys there are.
        clock: the hull's clock.
    """

    def __init__(self, settings: HullSettings) -> None:
        self._settings = settings
        self._window = settings.window
        self.held: dict[Key, Entity] = {}
        self.clock: int | None = None

    @property
    def follows_server(self) -> bool:
        return self._window is None or self._window.clock == "server"

    def apply(self, rows: KeyRows) -> Effect:
        """Put and remove keys."""
        removed = sum(self.held.pop(key, None) is not None for key in _listed(rows.removes))
        count = {"new": 0, "moved": 0, "stale": 0, "skipped": 0}
        for row, key in enumerate(_listed(rows.keys)):
            time = NO_TIME if rows.times is None else int(rows.times[row])
            deadline = FOREVER if rows.deadlines is None else int(rows.deadlines[row])
            entity = Entity(float(rows.points[row, 0]), time, deadline)
            count[self._put(key, entity, rows.condition)] += 1
        return count["new"], count["moved"], count["stale"], count["skipped"], removed, self._evict()

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
        oldest = sorted(self.held, key=lambda key: (self.held[key].time, key))  # type: ignore[arg-type, return-value]
        leaving = oldest[: len(oldest) - most] if most else []
        for key in leaving:
            del self.held[key]
        return len(leaving)

    def expire(self, rows: Expiry, clock: int) -> bool:
        """Let those leave that are too old, or whose time has come. Whether they are as many as was said."""
        leaving = self.overdue(clock, rows.until)
        for key in leaving:
            del self.held[key]
        return len(leaving) == rows.points > 0

    def overdue(self, clock: int, until: int | None = None) -> list[Key]:
        """Who has to have left when the hull's clock is `clock`."""
        if until is None and self._window is not None and self._window.max_age:
            until = clock - self._window.max_age
        return [
            key
            for key, entity in self.held.items()
            if (until is not None and NO_TIME < entity.time <= until) or entity.deadline <= clock
        ]


def _listed(keys: object) -> list[Key]:
    return [key if isinstance(key, str) else int(key) for key in keys]  # type: ignore[attr-defined]
