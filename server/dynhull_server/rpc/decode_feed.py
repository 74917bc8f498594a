"""Where a feed begins, and of which hulls it is."""

from dynhull_proto.v1 import feed_pb2

from ..engine.positions import BEGINNING, Standing, decode_standings
from ..engine.rosters import Choice
from ..state.feed_consumers import ConsumerId, FedBy
from .decode import LARGEST_INTEGER, NAME, InvalidFieldError, decode_name, page_size, require_prefix
from .decode_fence import decode_consumer


def decode_feed_consumer(request: feed_pb2.FeedRequest) -> str | None:
    """The consumer that knows where the feed begins; None for another start."""
    return decode_consumer(request.consumer) if request.HasField("consumer") else None


def decode_feed_start(request: feed_pb2.FeedRequest) -> int | None:
    """The revision after which the feed of a hull begins, None for the newest; without a consumer."""
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


def decode_fed_by(request: feed_pb2.AckFeedRequest | feed_pb2.DeleteFeedConsumerRequest) -> FedBy:
    """The hull or the prefix of a feed."""
    if not request.HasField("prefix"):
        return FedBy(decode_name(request.name))
    if request.name:
        raise InvalidFieldError("name", request.name, "give a name or a prefix, not both")
    require_prefix(request.prefix)
    return FedBy(request.prefix, True)


def decode_acknowledged(request: feed_pb2.AckFeedRequest) -> int:
    """The revision that a consumer of a hull acknowledges."""
    if request.position:
        raise InvalidFieldError("position", f"{len(request.position)} bytes", "is for a prefix: give revision")
    if request.revision > LARGEST_INTEGER:
        raise InvalidFieldError("revision", request.revision, f"must be at most {LARGEST_INTEGER}")
    return request.revision


def decode_acknowledged_standings(request: feed_pb2.AckFeedRequest) -> list[Standing]:
    """The standings that a consumer of a prefix acknowledges, one for each partition; none for the beginning."""
    for field in ("revision", "uid"):
        if value := getattr(request, field):
            raise InvalidFieldError(field, value, "is for one hull: give position")
    try:
        return decode_standings(request.position)
    except ValueError as error:
        raise InvalidFieldError("position", f"{len(request.position)} bytes", str(error)) from None


def decode_consumers_page(request: feed_pb2.ListFeedConsumersRequest) -> tuple[str, ConsumerId | None, int]:
    """The prefix, the consumer before the page, and the size of the page."""
    require_prefix(request.prefix)
    return request.prefix, _consumer_before(request.page_token), page_size(request.page_size)


def _consumer_before(token: str) -> ConsumerId | None:
    if not token:
        return None
    match token.split(":"):
        case [feed, ("0" | "1") as prefix, name] if NAME.fullmatch(name):
            return ConsumerId(FedBy(feed, prefix == "1"), name)
        case _:
            raise InvalidFieldError("page_token", token, "not a page token of this call")


def _require_new(request: feed_pb2.FeedRequest) -> None:
    if not request.only_new:
        raise InvalidFieldError("only_new", "false", "true, or another start")
