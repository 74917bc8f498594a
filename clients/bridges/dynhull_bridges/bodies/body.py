"""The interfaces of bodies and headers, and the usual body."""

from typing import Protocol

from ..letters import CONTENT_TYPE, Letter


class Body(Protocol):
    """Makes the body of a delivery.

    Attributes:
        content_type: the media type.
    """

    content_type: str

    def text(self, letter: Letter) -> str:
        """The body for an event; RefusedError if there is none."""


class Header(Protocol):
    """A header of webhooks.

    Attributes:
        name: its name.
    """

    name: str

    def value(self, letter: Letter) -> str:
        """The value for an event; RefusedError if there is none."""


class CloudEvents:
    """The event itself."""

    content_type = CONTENT_TYPE

    def text(self, letter: Letter) -> str:
        """The CloudEvent."""
        return letter.text


CLOUD_EVENTS = CloudEvents()
