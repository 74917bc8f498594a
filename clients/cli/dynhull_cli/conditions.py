"""Which keys are put, and when they leave: the options of commands that put keys."""

from typing import Any, Literal

from .durations import more_than_0

Only = Literal["absent", "present"]
ONLY = "Put only keys that are absent from the hull, or only those that are present. Default: all."
TTL = "Time after which the keys leave the hull: 500ms, 90s, 30m, 2h or 7d; a number alone is seconds."


def conditions(
    only: Only | None, ttl: str | None, *, key: str | None, expires: str | None, accuracy: str | None
) -> dict[str, Any]:
    """The arguments `only` and `ttl` of a put. ValueError if options contradict each other."""
    reasons = {
        "--expires": (expires, "leave at times of their own"),
        "--accuracy": (accuracy, "have accuracies"),
        "--ttl": (ttl, "leave"),
        "--only": (only, "are known"),
    }
    for option, (value, what) in reasons.items():
        if value is not None and key is None:
            raise ValueError(f"{option} is given with --key: only keys {what}")
    if ttl is not None and expires is not None:
        raise ValueError("--ttl and --expires both say when keys leave: give one of them")
    given = {"only": only, "ttl": None if ttl is None else more_than_0(ttl, "--ttl")}
    return {name: value for name, value in given.items() if value is not None}
