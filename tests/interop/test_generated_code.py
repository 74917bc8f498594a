"""The contract as other languages' generators read it."""

import pytest

from dynhull_proto.v1 import (
    alarm_pb2,
    alarm_service_pb2,
    batch_pb2,
    fence_pb2,
    fence_service_pb2,
    hull_pb2,
    hull_service_pb2,
    points_pb2,
)

FILES = [
    each.DESCRIPTOR
    for each in (
        alarm_pb2,
        alarm_service_pb2,
        batch_pb2,
        fence_pb2,
        fence_service_pb2,
        hull_pb2,
        hull_service_pb2,
        points_pb2,
    )
]


@pytest.mark.parametrize("file", FILES, ids=[file.name for file in FILES])
def test_each_file_names_its_package_for_go(file):
    # protoc-gen-go stops at a file without it; one package for all of them, as they are one in the contract.
    assert file.GetOptions().go_package == "dynhull/v1;dynhullv1"
