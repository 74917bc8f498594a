"""What the engine refuses, and why. A refused request has changed nothing."""


class RefusedError(Exception):
    """A request that cannot be granted."""


class HullNotFoundError(RefusedError):
    """There is no hull of that name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no hull {name!r}")
        self.name = name


class HullExistsError(RefusedError):
    """There is a hull of that name already."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is a hull {name!r} already")
        self.name = name


class PointMissingError(RefusedError):
    """A batch deletes a point which is not there, or not often enough.

    Attributes:
        part: the part of the batch that names it, "deletes" or "origins".
        row: its row there.
        point: its coordinates.
    """

    def __init__(self, part: str, row: int, point: tuple[float, float]) -> None:
        super().__init__(f"{part} row {row}: there is no point {point} to delete; nothing of the batch was applied")
        self.part = part
        self.row = row
        self.point = point


class LimitExceededError(RefusedError):
    """A request goes beyond one of the server's limits.

    Attributes:
        limit: the limit's name.
        maximum: its value.
    """

    def __init__(self, limit: str, maximum: int) -> None:
        super().__init__(f"the server's limit {limit} is {maximum}")
        self.limit = limit
        self.maximum = maximum
