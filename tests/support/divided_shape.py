"""Hulls that tests create are divided among shards, where that is possible: `pytest --shape shards`."""

from typing import Any

import grpc

from dynhull_proto.v1 import hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

SHARDS = 3


class Dividing(grpc.UnaryUnaryClientInterceptor):
    def intercept_unary_unary(self, continuation: Any, details: Any, request: Any) -> Any:
        if isinstance(request, pb.CreateHullRequest):
            config = request.config
            if not (
                config.shards
                or config.frame == hull_pb2.FRAME_GEOGRAPHIC
                or config.window.max_points
                or config.HasField("quarantine")
            ):
                divided = pb.CreateHullRequest()
                divided.CopyFrom(request)
                divided.config.shards = SHARDS
                request = divided
        return continuation(details, request)


def install() -> None:
    """Have all channels of blocking clients divide hulls."""
    plain = grpc.insecure_channel

    def dividing(*arguments: Any, **options: Any) -> Any:
        return grpc.intercept_channel(plain(*arguments, **options), Dividing())

    grpc.insecure_channel = dividing
