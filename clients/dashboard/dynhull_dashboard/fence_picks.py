"""The fences on the page of one viewer."""

from collections.abc import Collection, Iterable

from .fence_cards import fence_table
from .fence_drawing import hulls_of
from .fence_feed import FenceFeed
from .hub import Hub
from .looks import FENCE_LOOKS, Look


class FencePicks:
    """The fences that a viewer has picked.

    Args:
        hub: the source of the fences.
        picked: the fences to begin with; None for the first ones of the hulls shown, until the viewer picks others.

    Attributes:
        untouched: whether neither the address nor the viewer has picked fences.
    """

    def __init__(self, hub: Hub, picked: Iterable[str] | None) -> None:
        self._hub = hub
        self._shown: dict[str, tuple[FenceFeed, Look]] = {}
        self._awaited: set[str] = set()
        self.untouched = picked is None
        self.show(picked or ())

    @property
    def names(self) -> list[str]:
        """The fences shown."""
        return list(self._shown)

    @property
    def feeds(self) -> list[FenceFeed]:
        """Their feeds."""
        return [feed for feed, _ in self._shown.values()]

    @property
    def looks(self) -> dict[str, Look]:
        """How each is drawn."""
        return {name: look for name, (_, look) in self._shown.items()}

    def show(self, picked: Iterable[str]) -> None:
        """Show these fences, as far as there are looks for them, and no others."""
        names = list(dict.fromkeys(picked))[: len(FENCE_LOOKS)]
        for name in self._shown.keys() - set(names):
            del self._shown[name]
            self._awaited.discard(name)
            self._hub.fences.release(name)
        for name in names:
            if name not in self._shown:
                taken = [look for _, look in self._shown.values()]
                look = next(look for look in FENCE_LOOKS if look not in taken)
                self._shown[name] = self._hub.fences.open(name), look
                self._awaited.add(name)

    def some(self, hulls: Collection[str]) -> list[str]:
        """The fences of these hulls, out of those that can be picked."""
        known = self._hub.hull_list.by_name
        listed = self._hub.fence_list.by_name.values()
        return [fence.name for fence in listed if not set(hulls).isdisjoint(hulls_of(fence, known))]

    def new_hulls(self) -> list[str]:
        """The hulls of the fences that have become known since the last call: they belong into the picture."""
        known = {feed.name: feed.fence for feed in self.feeds if feed.name in self._awaited and feed.fence is not None}
        self._awaited -= known.keys()
        return [name for fence in known.values() for name in hulls_of(fence, self._hub.hull_list.by_name)]

    def table(self, hulls: Collection[str], *, connected: bool) -> str:
        """Their table as HTML. `hulls` are those in the picture."""
        return fence_table(self._shown.values(), hulls, connected)

    def close(self) -> None:
        """Let go of all feeds."""
        self.show(())
