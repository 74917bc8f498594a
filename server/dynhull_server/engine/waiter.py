"""A caller that waits for one request."""

from typing import TYPE_CHECKING

from ..state.requests import Request

if TYPE_CHECKING:
    import asyncio


class Waiter:
    """A caller that waits for one request."""

    __slots__ = ("answered", "future")

    def __init__(self) -> None:
        self.answered = False
        self.future: asyncio.Future[None] | None = None

    def answer(self, _: Request) -> None:
        """Resume the caller: the request has been answered."""
        self.answered = True
        if self.future is not None and not self.future.done():
            self.future.set_result(None)
