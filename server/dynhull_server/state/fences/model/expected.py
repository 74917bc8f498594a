"""Keys that should be inside of a fence, by a time of day or within an age."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, date, datetime, time, timedelta
from functools import lru_cache
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from sortedcontainers import SortedSet

from ...records import NO_TIME
from .config import FenceConfig
from .records import Delay, Key, Subject

DAYS = "mon", "tue", "wed", "thu", "fri", "sat", "sun"
FORM = re.compile(r"(\d\d):(\d\d)(?::(\d\d))? (\S+)(?: (\S+))?")
WORDS = 'write HH:MM or HH:MM:SS, a time zone and perhaps days, as in "18:00 Europe/Berlin mon-fri,sun"'
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MICROSECOND = timedelta(microseconds=1)
# The days beside that of a time in which the next deadline is.
DAYS_AROUND = range(-1, 9)
# The hull under which expected keys are stored, and the key there that says up to when deadlines have passed.
NOWHERE = OF_ALL = ""


@dataclass(frozen=True, slots=True)
class Daily:
    """A time of day in a time zone, on some days of the week.

    A time that the clocks of the zone skip is that much later; one that comes twice is the first of the two (as in
    RFC 5545).

    Attributes:
        at: the time of day.
        zone: the time zone.
        days: the days, from 0 for Monday.
    """

    at: time
    zone: ZoneInfo
    days: frozenset[int]

    def after(self, moment: int) -> int:
        """The first such time after a moment, both in microseconds since 1970."""
        today = (EPOCH + moment * MICROSECOND).astimezone(self.zone).date()
        found = (self._on(today + timedelta(days=day)) for day in DAYS_AROUND)
        return min(each for each in found if each is not None and each > moment)

    def _on(self, day: date) -> int | None:
        if day.weekday() not in self.days:
            return None
        return (datetime.combine(day, self.at, self.zone) - EPOCH) // MICROSECOND


@lru_cache(maxsize=1024)
def daily(text: str) -> Daily:
    """A time of day as it is written; ValueError says what is wrong with it."""
    found = FORM.fullmatch(text)
    if found is None:
        raise ValueError(WORDS)
    hour, minute, second, zone, days = found.groups()
    try:
        at = time(int(hour), int(minute), int(second or 0))
    except ValueError:
        raise ValueError(f"there is no such time of day: {WORDS}") from None
    try:
        return Daily(at, ZoneInfo(zone), _days(days))
    except (ZoneInfoNotFoundError, ValueError, OSError):
        raise ValueError(f"the server knows no time zone {zone!r}, or no such days: {WORDS}") from None


def _days(text: str | None) -> frozenset[int]:
    found: set[int] = set()
    for part in (f"{DAYS[0]}-{DAYS[-1]}" if text is None else text).split(","):
        first, _, last = part.partition("-")
        begin, end = DAYS.index(first), DAYS.index(last or first)
        found |= {day % len(DAYS) for day in range(begin, (end if end >= begin else end + len(DAYS)) + 1)}
    return frozenset(found)


class Expectations:
    """Which of the keys that should be inside of a fence are, as its events say, and which were reported missing.

    Args:
        config: the settings of a fence that expects keys.
        began: since when it does.
        stored: by key what the storage has of each (see `Delay`), and under OF_ALL up to when deadlines have passed.

    Attributes:
        keys: the keys.
        passed: up to when deadlines have passed; of an age, since when it counts.
    """

    def __init__(self, config: FenceConfig, began: int, stored: Mapping[Key, Delay] | None = None) -> None:
        self.keys = frozenset(config.expected)
        self.passed = began
        self._within = config.expected_within
        self._daily = daily(config.expected_by) if config.expected_by else None
        self._inside: dict[Key, int] = {}  # the hulls of each key in which it is inside
        self._missing: dict[Key, int] = {}  # since when
        self._since = dict.fromkeys(self.keys, began)  # since when those are outside that are
        for key, each in (stored or {}).items():
            if key == OF_ALL:
                self.passed = each.since
                self._since |= dict.fromkeys(self.keys - (stored or {}).keys(), each.since)
            elif each.enters:
                self._missing[key] = each.since
            else:
                self._since[key] = each.since
        self._waiting: SortedSet[tuple[int, Key]] = SortedSet()
        self.found({})

    def found(self, inside: Mapping[Key, int]) -> None:
        """Take note of who is inside: in how many hulls. O(n log n)."""
        self._inside = {key: count for key, count in inside.items() if key in self.keys}
        self._waiting.clear()
        if self._daily is None:
            self._waiting.update(
                (self._since[key], key) for key in self.keys - self._inside.keys() - self._missing.keys()
            )

    def __len__(self) -> int:
        """The number of keys."""
        return len(self.keys)

    @property
    def first_due(self) -> int | None:
        """When the next key may be missing; None for never."""
        return self.due_after(self.passed) if self._daily is not None else self.due_after(NO_TIME)

    def due_after(self, moment: int) -> int | None:
        """The same of what comes after a moment."""
        if self._daily is not None:
            return self._daily.after(max(moment, self.passed))
        if self._waiting and self._waiting[0][0] + self._within > moment:
            return int(self._waiting[0][0]) + self._within
        after = next(self._waiting.irange((moment - self._within + 1,)), None)
        return None if after is None else int(after[0]) + self._within

    def missing_at(self, due: int) -> dict[Key, int]:
        """The keys that are missing at a moment that is due, ascending, with the time since when they are outside."""
        if self._daily is not None:
            return dict.fromkeys(sorted(self.keys - self._inside.keys()), NO_TIME)
        found = {key: since for since, key in self._waiting if since + self._within <= due}
        return {key: found[key] for key in sorted(found)}

    # Changes; each returns what is stored of the key from then on, None for nothing new

    def entered(self, key: Key) -> tuple[int | None, Delay | None]:
        """A key is inside of one hull more. Returns since when it was missing, if it was, and what is stored."""
        self._inside[key] = self._inside.get(key, 0) + 1
        since = self._missing.pop(key, None)
        if self._inside[key] > 1:
            return None, None
        self._waiting.discard((self._since[key], key))
        self._since[key] = NO_TIME
        changed = since is not None or self._daily is None
        return since, Delay(False, NO_TIME, 0, 0) if changed else None

    def left(self, key: Key, now: int) -> Delay | None:
        """A key is inside of one hull less."""
        self._inside[key] = self._inside.get(key, 0) - 1
        if self._inside[key] > 0:
            return None
        del self._inside[key]
        self._since[key] = now
        if self._daily is not None:
            return None
        self._waiting.add((now, key))
        return Delay(False, now, 0, 0)

    def missed(self, key: Key, due: int) -> Delay:
        """A key is reported missing."""
        self._waiting.discard((self._since[key], key))
        self._missing[key] = due
        return Delay(True, due, 0, 0)

    def pass_deadline(self, due: int) -> Delay | None:
        """A time of day has passed."""
        if self._daily is None:
            return None
        self.passed = due
        return self.stored

    @property
    def stored(self) -> Delay:
        """What is stored under OF_ALL."""
        return Delay(False, self.passed, 0, 0)


def expectations_of(
    config: FenceConfig, began: int, delays: Iterable[tuple[Subject, Delay]] = ()
) -> Expectations | None:
    """What a fence expects, given what the storage has beside its delays; None for nothing."""
    if not config.expected:
        return None
    return Expectations(config, began, {key: each for (hull, key), each in delays if not hull})
