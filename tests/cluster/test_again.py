"""What a gateway does when a hull has another owner: what it sends again, and how it ends what waits for the former."""

import asyncio

import grpc
import pytest
from google.rpc.status_pb2 import Status
from patience import PATIENCE

from dynhull_cluster.again import may_repeat
from dynhull_cluster.upstream import Upstream, lost_status
from dynhull_cluster.ways import OPTIONS
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.rpc.status import DrainingError, RelayedError, StartingError, error_status
from dynhull_server.state.errors import NotStoredError

HULLS = "/dynhull.v1.HullService/"
NUMBERED = pb.ApplyRequest(name="a", producer="p", sequence=1).SerializeToString()
UNNUMBERED = pb.ApplyRequest(name="a").SerializeToString()
TOGETHER = pb.ApplyTogetherRequest(producer="p", sequence=1).SerializeToString()


@pytest.mark.parametrize("status", [error_status(DrainingError()), error_status(StartingError())])
@pytest.mark.parametrize("method", ["Apply", "CreateHull", "GetHull"])
def test_what_has_not_begun_is_sent_again(method: str, status: Status) -> None:
    assert may_repeat(HULLS + method, UNNUMBERED, status)


@pytest.mark.parametrize(
    ("method", "message", "again"),
    [
        ("GetHull", UNNUMBERED, True),
        ("ListHulls", b"", True),
        ("Apply", NUMBERED, True),
        ("Apply", UNNUMBERED, False),
        ("ApplyTogether", TOGETHER, True),
        ("CreateHull", UNNUMBERED, False),
        ("DeleteHull", UNNUMBERED, False),
        ("Recenter", UNNUMBERED, False),
    ],
)
def test_what_may_have_been_done_is_sent_again_only_where_that_changes_nothing(
    method: str, message: bytes, *, again: bool
) -> None:
    assert may_repeat(HULLS + method, message, lost_status()) is again


def test_an_answer_is_an_answer() -> None:
    assert not may_repeat(HULLS + "GetHull", UNNUMBERED, error_status(NotStoredError("no room")))
    assert not may_repeat(HULLS + "GetHull", UNNUMBERED, Status(code=grpc.StatusCode.NOT_FOUND.value[0]))


def test_a_call_that_waits_for_a_connection_ends_when_it_is_severed() -> None:
    """gRPC cancels the call, but leaves whoever writes to it waiting for ever."""

    async def run() -> None:
        async with grpc.aio.insecure_channel("127.0.0.1:1", options=OPTIONS) as channel:  # where nobody listens
            upstream = Upstream(channel.stream_stream("/a/b")(wait_for_ready=True))
            writing = asyncio.create_task(upstream.write(b"request"))
            reading = asyncio.create_task(upstream.read())
            for _ in range(10):
                await asyncio.sleep(0)
            upstream.sever()
            async with asyncio.timeout(PATIENCE):
                assert not await writing
                with pytest.raises(RelayedError, match="the outcome is unknown"):
                    await reading
                with pytest.raises(RelayedError):
                    await upstream.read()

    asyncio.run(run())
