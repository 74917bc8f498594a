"""Counts with nouns, for messages."""


def plural(count: int, noun: str) -> str:
    """The number and the noun: 1 point, 2,000 points."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"
