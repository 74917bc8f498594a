"""What the relay delivers to: the interface, and how a delivery fails."""

import re
from collections.abc import Sequence
from typing import Protocol

from .letters import Letter
from .refusals.table import Meaning

PLACE = re.compile(r"\{(?:kind|name|type|fence)\}|\{\{|\}\}")


class NotDeliveredError(Exception):
    """A delivery failed for now: it is repeated until it succeeds.

    Attributes:
        retry_after: the seconds that the receiver asked to wait; None if it did not.
    """

    def __init__(self, message: str, retry_after: float | None = None) -> None:
        super().__init__(message)
        self.retry_after = retry_after


class RefusedError(NotDeliveredError):
    """The receiver does not want these letters: after some attempts they become dead letters.

    Attributes:
        letter: the one that it does not want; None if nothing is known about single ones.
    """

    letter: "Letter | None" = None


def not_delivered(meaning: Meaning, message: str, retry_after: float | None = None) -> NotDeliveredError:
    """The error that a refusal of a receiver is, by what it means."""
    kind = RefusedError if meaning is Meaning.FINAL else NotDeliveredError
    return kind(message, retry_after)


class GoneError(Exception):
    """The receiver wants nothing any more."""


class ReaderGoneError(Exception):
    """Nobody reads standard output any more."""


class Target(Protocol):
    """A receiver of letters. Several sources may share one; each awaits its own deliveries.

    Attributes:
        most: the largest number of letters in one delivery.
    """

    most: int

    async def deliver(self, letters: Sequence[Letter]) -> None:
        """Return once the receiver has the letters, which are of one source and in order, for good.

        Raises:
            NotDeliveredError: some may not have arrived. GoneError, ReaderGoneError: none will any more.
        """

    def place(self, letter: Letter) -> str:
        """Where a letter goes, without secrets: for messages, and to name what is gone."""

    async def close(self) -> None:
        """Release what the target holds."""


def filled(template: str, letter: Letter) -> str:
    """A URL, topic or subject with the source and the type of the event filled in.

    Doubled braces are braces; {fence} is what the name was called when fences were the only sources.
    """
    source = letter.source
    values = {"{kind}": source.kind, "{name}": source.name, "{fence}": source.name, "{type}": letter.type}
    values |= {"{{": "{", "}}": "}"}
    return PLACE.sub(lambda found: values[found[0]], template)


def check_places(template: str) -> None:
    """ValueError where `filled` would leave a brace that is no place to fill in."""
    if rest := re.search(r"\{[^{}]*\}?|\}", PLACE.sub("", template)):
        raise ValueError(f"--to: {rest[0]} is not {{kind}}, {{name}} or {{type}}; {{{{ and }}}} stand for braces")
