"""What an acknowledgement promises."""

from enum import StrEnum


class Durability(StrEnum):
    """What an acknowledgement promises. A batch is whole or absent in every case.

    SYNC: it is on the disk, and survives a power failure. INTERVAL: it survives the end of the process at once, a power
    failure after a tenth of a second. NONE: it survives the end of the process at once, a power failure when the
    operating system chooses.
    """

    SYNC = "sync"
    INTERVAL = "interval"
    NONE = "none"
