from collections.abc import Iterator

import grpc
import pytest

from dynhull_client import HullClient
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub


@pytest.fixture
def channel(address: str) -> Iterator[grpc.Channel]:
    with grpc.insecure_channel(address) as channel:
        yield channel


@pytest.fixture
def stub(channel: grpc.Channel) -> HullServiceStub:
    return HullServiceStub(channel)


@pytest.fixture
def client(address: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        yield client


@pytest.fixture
def hull(stub: HullServiceStub, name: str) -> str:
    """The name of an empty hull of the test's own."""
    stub.CreateHull(pb.CreateHullRequest(name=name))
    return name
