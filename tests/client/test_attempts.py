"""What a call says that was repeated until its timeout."""

import grpc
import pytest

from dynhull_client import DeadlineError, UnavailableError
from dynhull_client._calls import Call
from dynhull_client._feed import FeedPlace, feed
from dynhull_client._retry import Attempts
from dynhull_proto.v1 import feed_pb2, hull_service_pb2

AWAY = UnavailableError("the store hangs", grpc.StatusCode.UNAVAILABLE, "STORAGE_FAILED", {})
LATE = DeadlineError("late", grpc.StatusCode.DEADLINE_EXCEEDED, "", {})


def test_a_call_says_why_it_was_repeated() -> None:
    call = Call("GetHull", hull_service_pb2.GetHullRequest(name="fleet"), lambda answer: answer, None)
    attempts = Attempts(call, 30, 5)
    attempts.after(call, AWAY)
    with pytest.raises(DeadlineError, match="longer than 30 s; before: the store hangs"):
        attempts.after(call, LATE)


def test_a_feed_says_why_its_last_connection_was_lost_until_a_batch_has_come() -> None:
    place = FeedPlace(feed("fleet", after=0, reconnect=True, timeout=30), 5)
    place.end(AWAY)
    place.take(feed_pb2.FeedResponse(revision=3, uid="0123"))  # a connection is there, and nothing has come
    with pytest.raises(DeadlineError, match="late; before: the store hangs"):
        place.end(LATE)
    batch = feed_pb2.FeedBatch(hull="fleet", revision=4, uid="0123")
    place.take(feed_pb2.FeedResponse(revision=4, uid="0123", batches=[batch]))
    with pytest.raises(DeadlineError, match=r"^late$"):
        place.end(LATE)
