"""A call that an older server does not know is one clear error, which names the call."""

import re
from collections.abc import Callable, Iterator
from typing import Any

import grpc
import pytest
from command_line import dynhull
from older_server import no_grpc_server, older_server

import dynhull_client
from dynhull_client import DynhullError, HullClient, MethodUnknownError


@pytest.fixture(scope="module", params=[True, False], ids=["dynhull", "gRPC"])
def older(request: pytest.FixtureRequest) -> Iterator[str]:
    with older_server(says_so=request.param) as address:
        yield address


def written(client: HullClient) -> None:
    with client.writer("fleet") as writer:
        writer.put(insert=[[1, 2]])


def ingested(client: HullClient) -> None:
    with client.ingest("fleet") as stream:
        stream.apply(insert=[[1, 2]])


def piped(client: HullClient) -> None:
    with client.pipeline() as pipeline:
        pipeline.locate("fleet", [[1, 2]]).result()


CALLS: dict[str, Callable[[HullClient], Any]] = {
    "GetHull": lambda client: client.get_hull("fleet"),
    "Apply": lambda client: client.apply("fleet", insert=[[1, 2]]),
    "GetFence": lambda client: client.get_fence("yard"),
    "ReadPoints": lambda client: next(iter(client.read_points("fleet"))),
    "Watch": lambda client: next(iter(client.watch("fleet"))),
    "WatchFence": lambda client: next(iter(client.watch_fence("yard"))),
    "FenceEventsBetween": lambda client: next(iter(client.fence_events_between("fleet", "fleet"))),
    "Stream": written,
    "Ingest": ingested,
    "Query": piped,
}


def said(call: str) -> str:
    return (
        f"the server does not know the call {call}: it is older than its client, dynhull {dynhull_client.__version__}; "
        "upgrade the server first"
    )


@pytest.mark.parametrize("call", CALLS)
def test_an_unknown_call_names_itself_and_what_to_do(older: str, connect: type[HullClient], call: str) -> None:
    with connect(older) as client, pytest.raises(MethodUnknownError, match=re.escape(said(call))) as caught:
        CALLS[call](client)
    assert caught.value.code == grpc.StatusCode.UNIMPLEMENTED
    assert isinstance(caught.value, NotImplementedError)


def test_commands_say_it(older: str) -> None:
    shown = dynhull("list", "--address", older)
    assert (shown.exit_code, shown.stderr) == (1, f"error: {said('ListHulls')}\n")


def test_what_is_no_grpc_server_is_not_called_older(connect: type[HullClient]) -> None:
    with no_grpc_server() as address, connect(address) as client, pytest.raises(DynhullError) as caught:
        client.get_hull("fleet")
    assert not isinstance(caught.value, MethodUnknownError)
    assert "no gRPC server answers at this address" in str(caught.value)
