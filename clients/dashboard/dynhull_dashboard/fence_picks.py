"""The fences on the page of one viewer."""

from collections.abc import Collection, Iterable

from bokeh.models.widgets import Div

from .cards import key
from .fence_cards import fence_table
from .fence_drawing import hulls_of
from .fence_feed import FenceFeed
from .hub import Hub
from .looks import FENCE_LOOKS, Look
from .plane import Plane


class FencePicks:
    """The fences that a viewer has picked, and their table.

    Args:
        hub: the source of the fences.
        plane: the picture.
        table: is filled with their figures.
        picked: the fences to begin with; if empty, the first ones of the hulls shown, until the viewer picks others.

    Attributes:
        untouched: whether neither the address nor the viewer has named a fence.
    """

    def __init__(self, hub: Hub, plane: Plane, table: Div, picked: Iterable[str]) -> None:
        self._hub = hub
        self._plane = plane
        self._table = table
        self._shown: dict[str, tuple[FenceFeed, Look]] = {}
        self._awaited: set[str] = set()
        picked = list(picked)
        self.untouched = not picked
        self.show(picked)

    @property
    def names(self) -> list[str]:
        """The fences shown."""
        return list(self._shown)

    @property
    def feeds(self) -> list[FenceFeed]:
        """Their feeds."""
        return [feed for feed, _ in self._shown.values()]

    @property
    def legend(self) -> list[list[str]]:
        """For each fence its name, and its line as SVG."""
        return [[name, key(look)] for name, (_, look) in self._shown.items()]

    def show(self, picked: Iterable[str]) -> None:
        """Show these fences, as far as there are looks for them, and no others."""
        names = list(dict.fromkeys(picked))[: len(FENCE_LOOKS)]
        for name in self._shown.keys() - set(names):
            del self._shown[name]
            self._awaited.discard(name)
            self._plane.hide_fence(name)
            self._hub.fences.release(name)
        for name in names:
            if name not in self._shown:
                taken = [look for _, look in self._shown.values()]
                look = next(look for look in FENCE_LOOKS if look not in taken)
                self._shown[name] = self._hub.fences.open(name), look
                self._awaited.add(name)
                self._plane.show_fence(self._shown[name][0], look)

    def some(self, hulls: Collection[str]) -> list[str]:
        """The fences of these hulls, out of those that can be picked."""
        known = self._hub.server.hulls
        listed = self._hub.fence_list.fences.values()
        return [fence.name for fence in listed if not set(hulls).isdisjoint(hulls_of(fence, known))]

    def new_hulls(self) -> list[str]:
        """The hulls of the fences that have become known since the last call: they belong into the picture."""
        known = {feed.name: feed.fence for feed in self.feeds if feed.name in self._awaited and feed.fence is not None}
        self._awaited -= known.keys()
        return [name for fence in known.values() for name in hulls_of(fence, self._hub.server.hulls)]

    def update(self, hulls: Collection[str], connected: bool) -> None:
        """Update the table. `hulls` are those in the picture."""
        self._table.text = fence_table(self._shown.values(), hulls, connected)

    def close(self) -> None:
        """Let go of all feeds."""
        for name in self._shown:
            self._hub.fences.release(name)
