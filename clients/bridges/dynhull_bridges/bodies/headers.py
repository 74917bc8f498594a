"""Headers of webhooks, from the user: their values are templates, too."""

import re
from collections.abc import Sequence
from pathlib import Path

from ..letters import Letter
from ..sources import Kind
from ..target import RefusedError
from .template import Template

NAME = re.compile(r"[!#$%&'*+.^_`|~\w-]+", re.ASCII)
FORBIDDEN = re.compile(r"[\x00-\x08\x0a-\x1f\x7f]")  # CR and LF would begin another header
# What the relay or the protocol says itself.
OWN = "connection", "content-length", "content-type", "host", "transfer-encoding"
OWN_PREFIX = "webhook-"


class TemplateHeader:
    """A header of each webhook.

    Args:
        line: NAME: VALUE. Messages do not repeat the value, which may be a secret.
        kinds: the kinds of events that it is for.

    Raises:
        ValueError: it is none, or the value names no field.
    """

    def __init__(self, line: str, kinds: Sequence[Kind]) -> None:
        self.name, colon, value = line.partition(":")
        if not colon or not NAME.fullmatch(self.name):
            raise ValueError(f"--header {self.name if colon else ''!r}: give NAME: VALUE, or @FILE with such lines")
        if self.name.lower() in OWN or self.name.lower().startswith(OWN_PREFIX):
            raise ValueError(f"--header {self.name}: the relay sets it; --content-type says what bodies are")
        self._template = Template(value.strip(" \t"), f"--header {self.name}", "text/plain", kinds)
        if FORBIDDEN.search(value):
            raise ValueError(f"--header {self.name}: the value has a line break, or another control character")

    def value(self, letter: Letter) -> str:
        """The value for an event; RefusedError if it has a line break or another control character."""
        value = self._template.text(letter).strip(" \t")
        if FORBIDDEN.search(value):
            raise RefusedError(f"the header {self.name} has a line break, or another control character")
        return value


def read_headers(given: Sequence[str], kinds: Sequence[Kind]) -> list[TemplateHeader]:
    """Headers, and those in the lines of @FILE; ValueError names one that is none. OSError: no such file."""
    lines: list[str] = []
    for each in given:
        lines += Path(each[1:]).read_text("utf-8").splitlines() if each.startswith("@") else [each]
    return [TemplateHeader(each, kinds) for each in lines if each.strip()]
