"""The prefixes that one viewer has picked."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from .hub import Hub
from .looks import LOOKS, Look
from .many_feed import ManyFeed, Place

MOST_PREFIXES = 3


@dataclass(slots=True)
class ShownPrefix:
    """The hulls of a prefix on the page.

    Attributes:
        feed: the hulls.
        look: that of all of them.
        place: what the page has been sent.
    """

    feed: ManyFeed
    look: Look
    place: Place


class ManyPicks:
    """The prefixes on one page, each with a look.

    Args:
        hub: the source of the hulls.
    """

    def __init__(self, hub: Hub) -> None:
        self._hub = hub
        self._shown: dict[str, ShownPrefix] = {}

    @property
    def looks(self) -> dict[str, Look]:
        """The looks by prefix."""
        return {prefix: shown.look for prefix, shown in self._shown.items()}

    @property
    def feeds(self) -> list[tuple[ManyFeed, Look]]:
        """The feeds, with the looks of their hulls."""
        return [(shown.feed, shown.look) for shown in self._shown.values()]

    def show(self, picked: Iterable[str], taken: Iterable[Look]) -> None:
        """Show these prefixes; the first that there is room for. Their looks are none of those that hulls have."""
        prefixes = list(dict.fromkeys(picked))[:MOST_PREFIXES]
        for prefix in self._shown.keys() - set(prefixes):
            del self._shown[prefix]
            self._hub.many.release(prefix)
        used = set(taken)
        for prefix in prefixes:
            if prefix not in self._shown:
                free = (look for look in LOOKS if look not in used | set(self.looks.values()))
                look = next(free, LOOKS[0])  # there are as many as hulls, of which the page then shows fewer
                self._shown[prefix] = ShownPrefix(self._hub.many.open(prefix), look, Place())

    def messages(self) -> Iterator[str]:
        """What is new since the last call, as JSON."""
        for shown in self._shown.values():
            shown.place, message = shown.feed.since(shown.place)
            if message is not None:
                yield message
