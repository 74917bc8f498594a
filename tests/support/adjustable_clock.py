"""A clock whose wall time can be set."""

from dynhull_server.engine.threads import Clock


class AdjustableClock(Clock):
    """Its wall time is that many seconds ahead."""

    def __init__(self, ahead: float) -> None:
        self.ahead = ahead

    def wall(self) -> float:
        return super().wall() + self.ahead
