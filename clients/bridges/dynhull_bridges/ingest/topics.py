"""Topics with wildcards, and what these stand for."""

import re
from collections.abc import Callable

Captures = Callable[[str], tuple[str, ...]]


def captures_of(pattern: str, separator: str, one: str, rest: str) -> Captures:
    """The function that returns what the wildcards of a filter stand for in a topic.

    `one` is the wildcard for one level, `rest` that for all levels from there on.
    """
    parts = []
    for level in pattern.split(separator):
        if level == one:
            parts.append(f"([^{re.escape(separator)}]*)")
        elif level == rest:
            parts.append("(.*)")
        else:
            parts.append(re.escape(level))
    expression = re.compile(re.escape(separator).join(parts), re.DOTALL)

    def captures(topic: str) -> tuple[str, ...]:
        found = expression.fullmatch(topic)
        return found.groups() if found else ()

    return captures
