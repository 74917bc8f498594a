"""Pages of what the server lists in order."""

from collections.abc import AsyncIterator, Callable
from typing import TypeVar

Item = TypeVar("Item")


async def page(listed: AsyncIterator[Item], limit: int, passed: Callable[[Item], bool]) -> tuple[list[Item], bool]:
    """At most `limit` of what comes after the items of earlier pages, which are `passed`; and whether more follow.

    Reads what is listed up to there, O(1) memory.
    """
    found: list[Item] = []
    async for each in listed:
        if passed(each):
            continue
        if len(found) == limit:
            return found, True
        found.append(each)
    return found, False
