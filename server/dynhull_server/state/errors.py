"""What the engine refuses, and why. A refused request has changed nothing."""


def words(error: BaseException) -> str:
    """What went wrong: a MemoryError, for one, has no message."""
    return str(error) or type(error).__name__


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

    def __init__(self, limit: str, maximum: float) -> None:
        super().__init__(f"the limit {limit} is {maximum}")
        self.limit = limit
        self.maximum = maximum


class SequenceGapError(RefusedError):
    """A producer's batch has a number beyond the next one.

    Attributes:
        producer: who numbers.
        sequence: the number.
        expected: the one that should have come.
    """

    def __init__(self, producer: str, sequence: int, expected: int) -> None:
        super().__init__(f"batch {sequence} of producer {producer!r} came where {expected} was expected")
        self.producer = producer
        self.sequence = sequence
        self.expected = expected


class HullEmptyError(RefusedError):
    """A question that a hull without points has no answer to."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the hull {name!r} has no points")
        self.name = name


class HullUnsuitableError(RefusedError):
    """A question that has no answer for a hull with such a point.

    Attributes:
        name: the hull.
        point: the point.
    """

    def __init__(self, name: str, point: tuple[float, float], rule: str) -> None:
        super().__init__(f"the hull {name!r} has the point {point}: {rule}")
        self.name = name
        self.point = point


class RevisionForgottenError(RefusedError):
    """The hull of that revision is not remembered.

    Attributes:
        revision: the revision.
        oldest: the oldest revision remembered.
        newest: the newest.
    """

    def __init__(self, revision: int, oldest: int, newest: int) -> None:
        super().__init__(f"revision {revision} is not remembered: the oldest is {oldest}, the newest {newest}")
        self.revision = revision
        self.oldest = oldest
        self.newest = newest


class HullReplacedError(RefusedError):
    """The hull of that name is another one than before.

    Attributes:
        name: the name.
        uid: the uid of the hull there is now.
    """

    def __init__(self, name: str, uid: str) -> None:
        super().__init__(f"the hull {name!r} is another one than the one resumed, it has the uid {uid}")
        self.name = name
        self.uid = uid


class NotStoredError(RefusedError):
    """The storage did not take a change: nothing of it was applied, and it may be sent again."""


class DiskFullError(NotStoredError):
    """There is no room on the disk; nothing of the change was applied."""


class OutcomeUnknownError(Exception):
    """The storage failed in the middle of a change: it may have been applied or not.

    Whoever numbers batches finds out by asking for the producer's last number; everybody else, by reading.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"whether this was applied is unknown until the disk can be read again ({reason}): "
            "ask for the producer's last number, or read, before you send it again"
        )


class StoppingError(Exception):
    """The server is about to stop; nothing of the request was applied."""
