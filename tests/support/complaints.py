"""What an event loop complains about."""

import asyncio
from typing import Any

Complaint = dict[str, Any]


def complaints_of(loop: asyncio.AbstractEventLoop) -> list[Complaint]:
    """A list to which all is appended that goes to the loop's handler of exceptions from now on.

    Not what belongs to loops that ended before: gRPC has one queue for all loops of a process, and where one of them
    is closed before the last completion of a cancelled call has arrived, the next loop is told.
    """
    heard: list[Complaint] = []

    def hear(_: asyncio.AbstractEventLoop, complaint: Complaint) -> None:
        is_of_another = "PollerCompletionQueue" in complaint["message"] and "loop is closed" in str(
            complaint.get("exception")
        )
        if not is_of_another:
            heard.append(complaint)

    loop.set_exception_handler(hear)
    return heard
