"""The durability of acknowledged batches."""

from enum import StrEnum


class Durability(StrEnum):
    """The durability of acknowledged batches. With each of them a batch is kept as a whole or not at all.

    SYNC: a batch survives a power failure. INTERVAL: it survives the end of the process, and a power failure after a
    tenth of a second. NONE: it survives the end of the process, and a power failure once the operating system has
    written it.
    """

    SYNC = "sync"
    INTERVAL = "interval"
    NONE = "none"
