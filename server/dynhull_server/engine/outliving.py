"""Work that ends as it ends, even if who asked for it goes away."""

import asyncio
from collections.abc import Coroutine
from typing import Any, TypeVar

T = TypeVar("T")


class Outliving:
    """Tasks that callers wait for, and do not end."""

    def __init__(self) -> None:
        self._working: set[asyncio.Task[Any]] = set()

    def __len__(self) -> int:
        return len(self._working)

    async def run(self, work: Coroutine[Any, Any, T]) -> T:
        """The result of some work."""
        return await asyncio.shield(self.begin(work))

    def begin(self, work: Coroutine[Any, Any, T]) -> asyncio.Task[T]:
        """Begin some work."""
        working = asyncio.get_running_loop().create_task(work)
        self._working.add(working)
        working.add_done_callback(self._ended)
        return working

    def _ended(self, working: "asyncio.Task[Any]") -> None:
        self._working.discard(working)
        if not working.cancelled():
            working.exception()  # if the caller has gone nobody else asks for it, and asyncio would log a traceback
