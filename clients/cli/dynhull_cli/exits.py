"""Exit codes for scripts; 0 is success, 130 an interruption."""

from enum import IntEnum


class Exit(IntEnum):
    """The exit codes of failures, as the client page lists them."""

    FAILED = 1
    UNUSABLE = 2
    UNAVAILABLE = 3
    FORBIDDEN = 4
    INTERRUPTED = 130
