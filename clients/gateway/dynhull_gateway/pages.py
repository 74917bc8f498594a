"""Pages of what the server lists by name."""

from collections.abc import AsyncIterator
from typing import Protocol, TypeVar


class Named(Protocol):
    """Something with a name."""

    @property
    def name(self) -> str:
        """The name."""
        ...


Item = TypeVar("Item", bound=Named)


async def page(listed: AsyncIterator[Item], after: str, limit: int) -> tuple[list[Item], str | None]:
    """At most `limit` of what comes after a name, and the name after which the next page begins; None if it is last.

    Reads what is listed up to there, O(1) memory.
    """
    found: list[Item] = []
    async for each in listed:
        if each.name <= after:
            continue
        if len(found) == limit:
            return found, found[-1].name
        found.append(each)
    return found, None
