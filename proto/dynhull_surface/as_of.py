"""What asks about a hull as it is, or as it was at the moment that a text names."""

from functools import partial
from typing import Any


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


def moment_of(text: str) -> int | str:
    """A revision, which is all digits; or the text of a time."""
    return int(text) if text.isdecimal() and text.isascii() else text
