"""The rosters of those who watch many hulls: one for all who watch the same."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager
from typing import NamedTuple

from ..state.hull import Hull
from .roster import Roster


class Choice(NamedTuple):
    """Some hulls: those whose names begin with a prefix, or, if that is None, those that have one of some names."""

    prefix: str | None
    names: frozenset[str] = frozenset()

    def has(self, name: str) -> bool:
        """Whether a hull of that name is one of them."""
        return name in self.names if self.prefix is None else name.startswith(self.prefix)


class Rosters:
    """The rosters in use.

    Args:
        hulls: called for the hulls there are.

    Attributes:
        in_use: those in use, by what they hold.
    """

    def __init__(self, hulls: Callable[[], Iterable[Hull]]) -> None:
        self._hulls = hulls
        self.in_use: dict[Hashable, tuple[Choice, Roster]] = {}
        self._users: Counter[Hashable] = Counter()
        self._by_prefix: dict[str, list[Roster]] = {}
        self._by_name: dict[str, list[Roster]] = {}
        self._lengths: list[int] = []

    @contextmanager
    def use(self, kind: Hashable, choice: Choice, make: Callable[[], Roster]) -> Iterator[Roster]:
        """The roster of some hulls, for all who want the same kind of states of them. O(hulls) for the first.

        Raises LimitExceededError if they are too many.
        """
        key = kind, choice
        if key not in self.in_use:
            self.in_use[key] = choice, self._begin(choice, make())
        self._users[key] += 1
        try:
            yield self.in_use[key][1]
        finally:
            self._users[key] -= 1
            if not self._users[key]:
                del self._users[key]
                self._forget(*self.in_use.pop(key))

    def moved(self, hulls: Iterable[Hull]) -> None:
        """Note that hulls have changed, are new, or are gone. O(1) for each that nobody watches so."""
        for hull in hulls:
            for roster in self._watching(hull.name):
                if hull.ended:
                    roster.end(hull.name)
                else:
                    _note(roster, hull)

    def _watching(self, name: str) -> Iterator[Roster]:
        yield from self._by_name.get(name, ())
        for length in self._lengths:
            if length <= len(name):
                yield from self._by_prefix.get(name[:length], ())

    def _begin(self, choice: Choice, roster: Roster) -> Roster:
        for hull in self._hulls():
            if choice.has(hull.name):
                _note(roster, hull)
                roster.require_within_limits()
        if choice.prefix is None:
            for name in choice.names:
                self._by_name.setdefault(name, []).append(roster)
        else:
            self._by_prefix.setdefault(choice.prefix, []).append(roster)
        self._measure()
        return roster

    def _forget(self, choice: Choice, roster: Roster) -> None:
        roster.close()
        index, keys = (self._by_name, choice.names) if choice.prefix is None else (self._by_prefix, {choice.prefix})
        for key in keys:
            index[key].remove(roster)
            if not index[key]:
                del index[key]
        self._measure()

    def _measure(self) -> None:
        """Note how long prefixes are: a name is looked up by as much of it."""
        self._lengths = sorted({len(prefix) for prefix in self._by_prefix})


def _note(roster: Roster, hull: Hull) -> None:
    roster.change(hull.name, hull.committed, new=not hull.counts.revision)
