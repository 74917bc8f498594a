"""The server's clock."""

from .threads import Clock

MICROSECONDS = 1_000_000


class ServerTime:
    """Microseconds since 1970, which never go back: not if the wall clock is set back, and not over a restart.

    It starts at the wall clock's time, or at the latest time of an earlier start if that is later, and runs with the
    monotonic clock.

    Args:
        clock: the clocks of the machine.
        latest: the latest time known from earlier starts, None if there is none.
    """

    def __init__(self, clock: Clock, latest: int | None = None) -> None:
        self._monotonic = clock.monotonic
        wall = int(clock.wall() * MICROSECONDS)
        start = wall if latest is None else max(wall, latest)
        self._origin = start - int(clock.monotonic() * MICROSECONDS)

    def now(self) -> int:
        """The time."""
        return self._origin + int(self._monotonic() * MICROSECONDS)
