"""Why a request is refused, and what follows from it: status codes, exit codes, classes of errors, repetitions."""

from collections.abc import Mapping
from enum import Enum, IntEnum
from typing import NamedTuple


class Repeat(Enum):
    """Whether the same request may be sent again, because it may succeed without a change."""

    NO = "no"
    IDEMPOTENT = "reads and numbered batches"
    ANY = "any request: it has not begun"


class Exit(IntEnum):
    """An exit code of the commands, and what it means."""

    meaning: str

    def __new__(cls, code: int, meaning: str) -> "Exit":
        """An exit code with a meaning."""
        member = int.__new__(cls, code)
        member._value_ = code
        member.meaning = meaning
        return member

    DONE = 0, "success"
    FAILED = 1, "a hull differs, data is damaged or the server refused a request"
    UNUSABLE = 2, "the command or its input is unusable"
    UNAVAILABLE = 3, "the server does not answer, or cannot do it now"
    FORBIDDEN = 4, "the server requires another token"
    UNRELIABLE = 70, "`dynhull serve` ended itself because it could not rely on its own state"
    INTERRUPTED = 130, "interrupted"


class Code(Enum):
    """A status code of gRPC, by its name.

    Attributes:
        number: its number on the wire.
        http: the status of HTTP that stands for it.
        error: the class of the SDK for an answer without a reason, as gRPC itself and proxies give.
        repeat: whether such a request may be sent again, whatever the reason is.
    """

    def __init__(self, number: int, http: int, error: str = "DynhullError", repeat: Repeat = Repeat.NO) -> None:
        self.number = number
        self.http = http
        self.error = error
        self.repeat = repeat

    CANCELLED = 1, 503
    UNKNOWN = 2, 502
    INVALID_ARGUMENT = 3, 400
    DEADLINE_EXCEEDED = 4, 504, "DeadlineError"
    NOT_FOUND = 5, 404
    ALREADY_EXISTS = 6, 409
    PERMISSION_DENIED = 7, 403, "PermissionDeniedError"
    RESOURCE_EXHAUSTED = 8, 429, "LimitExceededError"
    FAILED_PRECONDITION = 9, 409
    ABORTED = 10, 409
    OUT_OF_RANGE = 11, 410
    UNIMPLEMENTED = 12, 501, "MethodUnknownError"
    INTERNAL = 13, 502
    UNAVAILABLE = 14, 503, "UnavailableError", Repeat.IDEMPOTENT
    DATA_LOSS = 15, 502
    UNAUTHENTICATED = 16, 401, "UnauthenticatedError"


class Reason(NamedTuple):
    """What follows from a reason.

    Attributes:
        code: the status code of gRPC.
        error: the class of the SDK.
        meaning: what has happened, for the documentation.
        repeat: whether the same request may be sent again; None if the code says so.
        http: the status of HTTP, where it differs from that of the code.
    """

    code: Code
    error: str
    meaning: str
    repeat: Repeat | None = None
    http: int | None = None


REASONS: Mapping[str, Reason] = {
    "ALARM_EXISTS": Reason(Code.ALREADY_EXISTS, "AlarmExistsError", "There is already an alarm of that name."),
    "ALARM_NOT_FOUND": Reason(Code.NOT_FOUND, "AlarmNotFoundError", "There is no alarm of that name."),
    "ALARM_NOT_RAISED": Reason(
        Code.FAILED_PRECONDITION,
        "AlarmNotRaisedError",
        "The alarm is not raised for the hull: nobody can acknowledge it.",
    ),
    "ALARM_REPLACED": Reason(
        Code.OUT_OF_RANGE,
        "AlarmReplacedError",
        "The alarm was restored from a backup, or deleted and created again; its sequences are others.",
    ),
    "CONSUMER_NOT_FOUND": Reason(
        Code.NOT_FOUND, "ConsumerNotFoundError", "The fence, the alarm or the feed has no consumer of that name."
    ),
    "DISK_FULL": Reason(
        Code.RESOURCE_EXHAUSTED, "LimitExceededError", "The server's disk is full; nothing was applied.", http=507
    ),
    "DRAINING": Reason(Code.UNAVAILABLE, "UnavailableError", "The server is shutting down.", Repeat.ANY),
    "FENCE_EXISTS": Reason(Code.ALREADY_EXISTS, "FenceExistsError", "There is already a fence of that name."),
    "FENCE_NOT_FOUND": Reason(Code.NOT_FOUND, "FenceNotFoundError", "There is no fence of that name."),
    "FENCE_REPLACED": Reason(
        Code.OUT_OF_RANGE,
        "FenceReplacedError",
        "The fence was restored from a backup, or deleted and created again; its sequences are others.",
    ),
    "HULLS_APART": Reason(
        Code.FAILED_PRECONDITION, "HullUnsuitableError", "Two hulls of one request belong to different workers."
    ),
    "HULL_EMPTY": Reason(
        Code.FAILED_PRECONDITION, "HullEmptyError", "The query has no answer for a hull without points."
    ),
    "HULL_EXISTS": Reason(Code.ALREADY_EXISTS, "HullExistsError", "There is already a hull of that name."),
    "HULL_FENCED": Reason(
        Code.FAILED_PRECONDITION,
        "HullFencedError",
        "The hull cannot be deleted before the fence or alarm that names it.",
    ),
    "HULL_NOT_FOUND": Reason(Code.NOT_FOUND, "HullNotFoundError", "There is no hull of that name."),
    "HULL_REPLACED": Reason(
        Code.OUT_OF_RANGE,
        "HullReplacedError",
        "A watch cannot resume, or a past is gone: the hull was restored from a backup, or deleted and created again.",
    ),
    "HULL_UNSUITABLE": Reason(
        Code.FAILED_PRECONDITION,
        "HullUnsuitableError",
        "The hull has keys or none, or keys of another kind, or the query has no answer for one of its points.",
    ),
    "INVALID_FIELD": Reason(
        Code.INVALID_ARGUMENT, "InvalidRequestError", "A field of the request has a value that is not allowed."
    ),
    "KEY_MISSING": Reason(
        Code.FAILED_PRECONDITION, "KeyMissingError", "A batch removes a key that the hull does not have."
    ),
    "KEY_REPEATED": Reason(Code.INVALID_ARGUMENT, "DuplicateKeyError", "A batch names a key twice."),
    "LIMIT_EXCEEDED": Reason(
        Code.RESOURCE_EXHAUSTED, "LimitExceededError", "The request exceeds a limit of the server, such as a size."
    ),
    "MALFORMED_MESSAGE": Reason(
        Code.INVALID_ARGUMENT, "InvalidRequestError", "The bytes of the request are not its message."
    ),
    "METHOD_UNKNOWN": Reason(
        Code.UNIMPLEMENTED, "MethodUnknownError", "The server is older than the client and does not know the call."
    ),
    "OUTCOME_UNKNOWN": Reason(
        Code.UNKNOWN,
        "OutcomeUnknownError",
        "The server's disk failed during the batch, which may have been applied; a writer resolves this itself.",
        Repeat.IDEMPOTENT,
    ),
    "PAST_DAMAGED": Reason(
        Code.DATA_LOSS,
        "PastDamagedError",
        "A part of the past is missing or damaged; the message names its revisions.",
        http=500,  # not of a gateway between: nobody is to repeat it
    ),
    "PERMISSION_DENIED": Reason(Code.PERMISSION_DENIED, "PermissionDeniedError", "The token does not allow the call."),
    "POINT_MISSING": Reason(
        Code.FAILED_PRECONDITION, "PointMissingError", "A batch deletes a point that the hull does not have."
    ),
    "PRODUCER_IN_USE": Reason(
        Code.FAILED_PRECONDITION, "ProducerInUseError", "Another writer uses the same name; found by the SDK."
    ),
    "RESTORED": Reason(
        Code.FAILED_PRECONDITION,
        "RestoredError",
        "The hull was restored from a backup that lacks some of the producer's batches; go on after the last it has.",
    ),
    "REVISION_FORGOTTEN": Reason(
        Code.OUT_OF_RANGE, "RevisionForgottenError", "The server does not keep that revision any more: begin again."
    ),
    "SEQUENCE_AHEAD": Reason(
        Code.OUT_OF_RANGE, "SequenceAheadError", "The sequence is after the last event of the fence.", http=409
    ),
    "SEQUENCE_GAP": Reason(
        Code.FAILED_PRECONDITION, "SequenceGapError", "The numbers of a producer's batches are not consecutive."
    ),
    "SERVICE_UNKNOWN": Reason(Code.NOT_FOUND, "DynhullError", "Health was requested of an unknown service."),
    "STARTING": Reason(
        Code.UNAVAILABLE, "UnavailableError", "The server, or the worker that has the hull, is starting.", Repeat.ANY
    ),
    "STORAGE_FAILED": Reason(
        Code.UNAVAILABLE, "UnavailableError", "The server cannot write to its storage; nothing was applied."
    ),
    "TOKENS_CHANGED": Reason(
        Code.UNAVAILABLE, "UnavailableError", "Between processes of a server: the tokens have changed; a watch goes on."
    ),
    "TOO_MANY_CALLS": Reason(
        Code.UNAVAILABLE,
        "UnavailableError",
        "The connection has too many calls already; found by the SDK, which repeats the call as long as it may take.",
        Repeat.ANY,
    ),
    "UNAUTHENTICATED": Reason(
        Code.UNAUTHENTICATED, "UnauthenticatedError", "The server requires a token and knows none in the request."
    ),
}

# Refusals of a server that has not begun to do what was asked.
NOT_BEGUN = frozenset(name for name, reason in REASONS.items() if reason.repeat is Repeat.ANY)

# The exit codes of commands by the class of the error, for those that are not FAILED; subclasses have the same.
EXITS: Mapping[str, Exit] = {
    "DeadlineError": Exit.UNAVAILABLE,
    "InvalidRequestError": Exit.UNUSABLE,
    "PermissionDeniedError": Exit.FORBIDDEN,
    "UnauthenticatedError": Exit.FORBIDDEN,
    "UnavailableError": Exit.UNAVAILABLE,
}


def repeat_of(reason: str, code: str) -> Repeat:
    """Whether a request may be sent again after a reason, empty or unknown for none, with the name of a code."""
    known = REASONS.get(reason)
    if known is not None and known.repeat is not None:
        return known.repeat
    return Code[code].repeat if code in Code.__members__ else Repeat.NO


def http_of(reason: str, code: str) -> int:
    """The status of HTTP for a reason, empty or unknown for none, with the name of a code."""
    known = REASONS.get(reason)
    if known is not None and known.http is not None:
        return known.http
    return (Code[code] if code in Code.__members__ else Code.UNKNOWN).http


def exit_of(error: type[BaseException]) -> Exit:
    """The exit code of a command that ends with an error of the SDK."""
    return next((EXITS[each.__name__] for each in error.__mro__ if each.__name__ in EXITS), Exit.FAILED)
