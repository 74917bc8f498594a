"""What asks about a hull as it is, or as it was at the moment that a text names."""

from functools import partial
from typing import Any

from .iso_times import from_iso

REVISION_DIGITS, SHOWN_CHARACTERS = 20, 60


class Present:
    """The reading methods of a client for one hull, without its name.

    Args:
        client: the client.
        name: the hull.
    """

    def __init__(self, client: Any, name: str) -> None:
        self._client = client
        self._name = name

    def __getattr__(self, method: str) -> Any:
        return partial(getattr(self._client, method), self._name)


def moment_of(text: str | None, name: str) -> int | str | None:
    """A revision, which is all digits; or the text of a time with a time zone; None for None.

    Raises:
        ValueError: it is neither, or no revision has that number; the message has the name.
    """
    if text is None:
        return None
    try:
        return read_moment(text)
    except ValueError as error:
        raise ValueError(f"{name} is {text[:SHOWN_CHARACTERS]!r}: {error}") from None


def read_moment(text: str) -> int | str:
    """A revision, which is all digits; or the text of a time with a time zone.

    Raises:
        ValueError: it is neither, or no revision has that number; the message does not say where it was found.
    """
    if text.isdecimal() and text.isascii():
        digits = text.lstrip("0") or "0"
        if len(digits) > REVISION_DIGITS or int(digits) >= 2**64:  # Python refuses thousands of digits in its own words
            raise ValueError("must be less than 2**64")
        return int(digits)
    try:
        zone = from_iso(text).tzinfo
    except ValueError:
        zone = None
    if zone is None:
        raise ValueError("must be a revision, all digits, or a time with a time zone, such as 2026-11-24T16:00Z")
    return text
