"""Where a feed begins, and of which hulls it is."""

from dynhull_proto.v1 import feed_pb2

from ..engine.positions import BEGINNING, Standing, decode_standings
from ..engine.rosters import Choice
from .decode import LARGEST_INTEGER, InvalidFieldError, require_prefix


def decode_feed_start(request: feed_pb2.FeedRequest) -> int | None:
    """The revision after which the feed of a hull begins, None for the newest."""
    start = request.WhichOneof("start")
    if start == "position":
        raise InvalidFieldError("position", f"{len(request.position)} bytes", "is for a prefix: give after_revision")
    if start == "only_new":
        _require_new(request)
        return None
    if request.after_revision > LARGEST_INTEGER:
        raise InvalidFieldError("after_revision", request.after_revision, f"must be at most {LARGEST_INTEGER}")
    return request.after_revision


def decode_feed_choice(request: feed_pb2.FeedRequest) -> Choice | None:
    """The hulls of a feed of many; None for the feed of one."""
    if not request.HasField("prefix"):
        return None
    if request.name:
        raise InvalidFieldError("name", request.name, "give a name or a prefix, not both")
    if request.uid:
        raise InvalidFieldError("uid", request.uid, "is for one hull: a position says of which data it is")
    require_prefix(request.prefix)
    return Choice(request.prefix)


def decode_feed_standings(request: feed_pb2.FeedRequest) -> list[Standing] | None:
    """How far the reader of many hulls is, for each partition, or the beginning for all; None for what is new."""
    match request.WhichOneof("start"):
        case "only_new":
            _require_new(request)
            return None
        case "position":
            try:
                return decode_standings(request.position)
            except ValueError as error:
                raise InvalidFieldError("position", f"{len(request.position)} bytes", str(error)) from None
        case _:
            if request.after_revision:
                problem = "must be 0, for all that is kept: hulls of a prefix have a position"
                raise InvalidFieldError("after_revision", request.after_revision, problem)
            return [BEGINNING]


def _require_new(request: feed_pb2.FeedRequest) -> None:
    if not request.only_new:
        raise InvalidFieldError("only_new", "false", "true, or another start")
