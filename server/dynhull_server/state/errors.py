"""The reasons why the engine refuses requests. A refused request has changed nothing."""

from datetime import datetime, timedelta


def words(error: BaseException) -> str:
    """The message of an error, or its class name where it has none, as a MemoryError."""
    return str(error) or type(error).__name__


def words_for_callers(error: BaseException) -> str:
    """The message of an error, without what only the operator of the server should read."""
    if isinstance(error, OSError) and error.strerror:  # its message has the path of a file, too
        return str(error.strerror)
    return getattr(error, "for_callers", "") or words(error)


def _iso(micros: int) -> str:
    """A time in microseconds since 1970, for people."""
    try:
        return (datetime(1970, 1, 1) + timedelta(microseconds=micros)).isoformat() + "Z"
    except OverflowError:
        return f"{micros} microseconds after 1970"


class RefusedError(Exception):
    """A request that cannot be granted."""


class HullNotFoundError(RefusedError):
    """No hull has that name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no hull {name!r}")
        self.name = name


class HullExistsError(RefusedError):
    """A hull of that name already exists."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the hull {name!r} already exists")
        self.name = name


class PointMissingError(RefusedError):
    """A batch deletes a point that the hull does not have, or not that often.

    Attributes:
        part: the field of the batch that has the point, "deletes" or "origins".
        row: its row in that field.
        point: its coordinates.
    """

    def __init__(self, part: str, row: int, point: tuple[float, float]) -> None:
        super().__init__(f"{part} row {row}: the hull has no point {point} to delete; nothing of the batch was applied")
        self.part = part
        self.row = row
        self.point = point


class InvalidBatchError(RefusedError):
    """A batch has an invalid value, given the settings of the hull.

    Attributes:
        field: the path of the field in the batch.
        row: the row of the value, None if the field as a whole is invalid.
        value: the value.
        problem: the reason why it is invalid.
    """

    def __init__(self, field: str, value: object, problem: str, row: int | None = None) -> None:
        super().__init__(f"{field if row is None else f'{field} row {row}'} is {value}: {problem}")
        self.field = field
        self.row = row
        self.value = value
        self.problem = problem


class InvalidPlaceError(RefusedError):
    """A request has a place that the geographic hull cannot answer for.

    Attributes:
        field: the path of the field in the request.
        row: its row.
        value: the place.
        problem: the reason.
    """

    def __init__(self, field: str, row: int, value: object, problem: str) -> None:
        super().__init__(f"{field} row {row} is {value}: {problem}")
        self.field = field
        self.row = row
        self.value = value
        self.problem = problem


class KeyRepeatedError(InvalidBatchError):
    """A batch names a key twice.

    Attributes:
        first: the field and the row in which the key comes first; `field` and `row` say where it comes again.
    """

    def __init__(self, key: str | int, first: tuple[str, int], second: tuple[str, int]) -> None:
        field, row = first
        problem = f"a batch names a key once, and {field} row {row} is the same key; nothing of the batch was applied"
        super().__init__(second[0], key, problem, second[1])
        self.first = first


class KeyMissingError(RefusedError):
    """A batch removes a key that the hull does not have.

    Attributes:
        row: its row among the removes.
        key: the key.
    """

    def __init__(self, row: int, key: str | int) -> None:
        super().__init__(f"removes row {row}: the hull has no key {key!r} to remove; nothing of the batch was applied")
        self.row = row
        self.key = key


class LimitExceededError(RefusedError):
    """A request exceeds one of the server's limits.

    Attributes:
        limit: the name of the limit.
        maximum: its value.
    """

    def __init__(self, limit: str, maximum: float, of_what: str = "") -> None:
        super().__init__(f"the limit {limit} is {maximum}{of_what and f': {of_what}'}")
        self.limit = limit
        self.maximum = maximum


class SequenceGapError(RefusedError):
    """A producer skipped a sequence number.

    Attributes:
        producer: the name of the producer.
        sequence: the number sent.
        expected: the next number.
        uid: the uid of the hull, for who has said of which hull the numbers are; empty for others.
    """

    def __init__(self, producer: str, sequence: int, expected: int, words: str = "") -> None:
        super().__init__(words or f"batch {sequence} of producer {producer!r} arrived, expected {expected}")
        self.uid = ""
        self.producer = producer
        self.sequence = sequence
        self.expected = expected


class RestoredError(RefusedError):
    """The numbers of a producer are from before a backup of the hull was restored.

    Attributes:
        name: the name of the hull.
        uid: the present uid of the hull.
        producer: the name of the producer.
        last: the number of its last batch that the hull has.
    """

    def __init__(self, name: str, uid: str, producer: str, last: int) -> None:
        super().__init__(
            f"the hull {name!r} was restored from a backup, and the last batch of producer {producer!r} that it has is "
            f"number {last}: those after it are gone, so go on from there, with a new writer"
        )
        self.name = name
        self.uid = uid
        self.producer = producer
        self.last = last


class SequencesDifferError(SequenceGapError):
    """A producer's batch to several hulls has been applied to some of them, with the same number, but not to all."""

    def __init__(self, producer: str, sequence: int, expected: int, applied: str, missing: str) -> None:
        super().__init__(
            producer,
            sequence,
            expected,
            f"batch {sequence} of producer {producer!r} has been applied to {applied!r}, which expects {expected}, but "
            f"not to {missing!r}: a producer of batches to several hulls writes to all of them each time",
        )


class HullEmptyError(RefusedError):
    """The query is undefined for a hull without points."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the hull {name!r} has no points")
        self.name = name


class MisfitError(Exception):
    """A batch is not of the kind that the hull takes.

    Attributes:
        field: the path of the field in the batch.
    """

    def __init__(self, field: str, reason: str) -> None:
        super().__init__(reason)
        self.field = field


class HullUnsuitableError(RefusedError):
    """The request does not suit the hull: a batch of another kind, or a query undefined for its points.

    Attributes:
        name: the name of the hull.
        point: the coordinates of the point for which the query is undefined; None if that is not the reason.
        field: the field of the request that does not suit the hull; empty if the request as a whole does not.
    """

    def __init__(self, name: str, reason: str, point: tuple[float, float] | None = None, *, field: str = "") -> None:
        super().__init__(f"the hull {name!r} {reason}")
        self.name = name
        self.point = point
        self.field = field


class RevisionForgottenError(RefusedError):
    """That revision is no longer known.

    Attributes:
        revision: the revision.
        oldest: the oldest revision that is.
        newest: the newest.
        field: the field of the request that has the revision.
    """

    def __init__(
        self,
        revision: int,
        oldest: int,
        newest: int,
        oldest_time: int | None = None,
        field: str = "resume.revision",
    ) -> None:
        since = "" if oldest_time is None else f" of {_iso(oldest_time)}"
        super().__init__(f"revision {revision} is not kept: the oldest is {oldest}{since}, the newest {newest}")
        self.revision = revision
        self.oldest = oldest
        self.newest = newest
        self.field = field


class MomentForgottenError(RefusedError):
    """The state at that time is not kept any more, or the time has not come.

    Attributes:
        time: the time, in microseconds since 1970.
        oldest: the oldest revision whose commit is known; None for a time that has not come.
        newest: the newest.
        field: the field of the request that has the time.
    """

    def __init__(
        self,
        time: int,
        oldest: int | None,
        oldest_time: int | None,
        newest: int | None,
        field: str = "at_time",
    ) -> None:
        if oldest is None:
            problem = "is not over by the server's clock"
        elif oldest_time is None:
            problem = "cannot be answered: an earlier version wrote this hull, without times"
        else:
            problem = f"is before the oldest revision with a time, {oldest} of {_iso(oldest_time)}"
        super().__init__(f"{_iso(time)} {problem}")
        self.time = time
        self.oldest = oldest
        self.newest = newest
        self.field = field


class PagesForgottenError(RefusedError):
    """The vertices of that revision are not kept for pages any more.

    Attributes:
        revision: the revision.
    """

    def __init__(self, revision: int) -> None:
        super().__init__(f"revision {revision} is not kept for pages any more: begin again without a page token")
        self.revision = revision


class PositionForgottenError(RefusedError):
    """The position of a feed is of other data than those that there are."""

    def __init__(self) -> None:
        super().__init__(
            "this position is of other data: a backup was restored, or the hulls were divided among other processes; "
            "begin again, from what there is"
        )


class HullReplacedError(RefusedError):
    """The hull of that name has been deleted and created again, or restored from a backup.

    Attributes:
        name: the name.
        uid: the uid of the present hull.
        field: what named the hull before.
    """

    def __init__(self, name: str, uid: str, field: str = "resume.uid") -> None:
        super().__init__(f"the hull {name!r} was created again, or restored from a backup: its uid is now {uid}")
        self.field = field
        self.name = name
        self.uid = uid


class FenceNotFoundError(RefusedError):
    """No fence has that name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no fence {name!r}")
        self.name = name


class FenceExistsError(RefusedError):
    """A fence of that name already exists."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the fence {name!r} already exists")
        self.name = name


class FenceReplacedError(RefusedError):
    """The fence of that name has been deleted and created again, or restored from a backup.

    Attributes:
        name: the name.
        uid: the uid of the present fence.
    """

    def __init__(self, name: str, uid: str) -> None:
        super().__init__(f"the fence {name!r} was created again, or restored from a backup: its uid is now {uid}")
        self.name = name
        self.uid = uid


class InvalidFenceError(RefusedError):
    """The settings of a fence are invalid, or do not suit its hulls.

    Attributes:
        field: the path of the field in the settings.
        value: the value.
        problem: the reason why it is invalid.
    """

    def __init__(self, field: str, value: object, problem: str) -> None:
        super().__init__(f"{field} is {value}: {problem}")
        self.field = field
        self.value = value
        self.problem = problem


class HullFencedError(RefusedError):
    """A hull cannot be deleted because a fence depends on it.

    Attributes:
        name: the name of the hull.
        fence: the name of a fence, or of an alarm, that depends on it; None if it is not to be told.
        what: "fence" or "alarm".
    """

    def __init__(self, name: str, fence: str | None = None, what: str = "fence") -> None:
        told = (
            f"a{'n' * (what == 'alarm')} {what} that this token may not read"
            if fence is None
            else f"the {what} {fence!r}"
        )
        super().__init__(f"{told} depends on the hull {name!r}: delete the {what} first")
        self.name = name
        self.fence = fence
        self.what = what


class AlarmNotFoundError(RefusedError):
    """No alarm has that name."""

    def __init__(self, name: str) -> None:
        super().__init__(f"there is no alarm {name!r}")
        self.name = name


class AlarmExistsError(RefusedError):
    """An alarm of that name already exists."""

    def __init__(self, name: str) -> None:
        super().__init__(f"the alarm {name!r} already exists")
        self.name = name


class AlarmReplacedError(RefusedError):
    """The alarm of that name has been deleted and created again, or restored from a backup.

    Attributes:
        name: the name.
        uid: the uid of the present alarm.
    """

    def __init__(self, name: str, uid: str) -> None:
        super().__init__(f"the alarm {name!r} was created again, or restored from a backup: its uid is now {uid}")
        self.name = name
        self.uid = uid


class AlarmNotRaisedError(RefusedError):
    """There is nothing to acknowledge: the alarm is not raised for the hull."""

    def __init__(self, name: str, hull: str) -> None:
        super().__init__(f"the alarm {name!r} is not raised for the hull {hull!r}")
        self.name = name
        self.hull = hull


class ConsumerNotFoundError(RefusedError):
    """The fence, or the alarm, has no consumer of that name."""

    def __init__(self, fence: str, name: str, what: str = "fence") -> None:
        super().__init__(f"the {what} {fence!r} has no consumer {name!r}")
        self.fence = fence
        self.name = name


class SequenceAheadError(RefusedError):
    """A sequence is after the last event of a fence.

    Attributes:
        field: the field of the request.
        sequence: the sequence.
        last: the sequence of the last event.
    """

    def __init__(self, field: str, sequence: int, last: int) -> None:
        super().__init__(f"sequence {sequence} is after the last event, {last}")
        self.field = field
        self.sequence = sequence
        self.last = last


class NotStoredError(RefusedError):
    """The storage failed to keep a change: nothing of it was applied, and it may be sent again."""


class DiskFullError(NotStoredError):
    """The disk is full; nothing of the change was applied."""


class PastDamagedError(NotStoredError):
    """What is kept of the past is missing or damaged, and stays so until somebody brings it back."""


class ShardAwayError(RefusedError):
    """A shard of the hull does not answer, so nothing of the request was applied, and it may be sent again.

    Attributes:
        shard: its number.
    """

    def __init__(self, name: str, shard: int) -> None:
        super().__init__(f"shard {shard} of hull {name!r} is away; nothing of the request was applied: try again later")
        self.shard = shard


class PartRefusedError(Exception):
    """One of the batches of a request to several hulls was refused, and so none was applied.

    Attributes:
        index: the index of the batch in the request.
        reason: why it was refused.
    """

    def __init__(self, index: int, reason: Exception) -> None:
        super().__init__(index, reason)
        self.index = index
        self.reason = reason


class OutcomeUnknownError(Exception):
    """The storage failed in the middle of a change: it may have been applied or not.

    A caller that numbers its batches can ask for the producer's last number; any other can read the hull.
    """

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"it is unknown whether this was applied, until the storage can be read again ({reason}): "
            "ask for the producer's last number, or read the hull, before you send it again"
        )


class StoppingError(Exception):
    """The server is shutting down; nothing of the request was applied."""
