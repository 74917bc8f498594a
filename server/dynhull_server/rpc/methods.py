"""The service's methods as gRPC wants them: each through `Calls.serve`, bytes that are no message refused."""

from collections.abc import Callable
from functools import partial
from typing import Any

import grpc
from google.protobuf.descriptor import MethodDescriptor
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass

from dynhull_proto.v1 import hull_service_pb2

from ..state.errors import LimitExceededError
from .calls import Call, Calls, Received, Work
from .hull_service import HullService

DESCRIPTOR = hull_service_pb2.DESCRIPTOR.services_by_name["HullService"]

# A draining server finishes these, and cuts off the other calls.
FINISHED = {"CreateHull", "DeleteHull", "ListHulls", "Apply"}

MAKERS: dict[tuple[bool, bool], Callable[..., Any]] = {
    (False, False): grpc.unary_unary_rpc_method_handler,
    (False, True): grpc.unary_stream_rpc_method_handler,
    (True, False): grpc.stream_unary_rpc_method_handler,
    (True, True): grpc.stream_stream_rpc_method_handler,
}


def method_handlers(service: HullService, calls: Calls) -> grpc.GenericRpcHandler:
    """The service for `Server.add_generic_rpc_handlers`."""
    handlers = {}
    for method in DESCRIPTOR.methods:
        streams = method.client_streaming, method.server_streaming
        wrap = _streaming if any(streams) else _unary
        handlers[method.name] = MAKERS[streams](
            partial(calls.serve, method.name, wrap(method, getattr(service, method.name), calls)),
            request_deserializer=_received(GetMessageClass(method.input_type), calls.max_message_bytes),
        )
    return grpc.method_handlers_generic_handler(DESCRIPTOR.full_name, handlers)


def _unary(method: MethodDescriptor, behave: Work, calls: Calls) -> Work:
    until_drain = calls.short if method.name in FINISHED else calls.cutoff

    async def work(request: Any, call: Call) -> bytes:
        with until_drain():
            response = await behave(call.take(request), call)
        return call.serialize(response)

    return work


def _streaming(method: MethodDescriptor, behave: Work, calls: Calls) -> Work:
    async def work(request: Any, call: Call) -> bytes | None:
        with calls.stream():
            response = await behave(None if method.client_streaming else call.take(request), call)
        return None if response is None else call.serialize(response)

    return work


def _received(kind: type[Message], max_bytes: int) -> Callable[[bytes], Received]:
    """A deserializer that returns what is wrong: what it raised, gRPC would answer with UNKNOWN."""

    def deserialize(data: bytes) -> Received:
        if len(data) > max_bytes:
            return LimitExceededError("max_message_bytes", max_bytes)
        try:
            return kind.FromString(data), len(data)
        except DecodeError as error:
            return error

    return deserialize
