"""The service's methods as gRPC wants them: each inside `Calls.enter`, bytes that are no message refused."""

from collections.abc import Awaitable, Callable
from typing import Any

import grpc
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass

from dynhull_proto.v1 import hull_service_pb2

from ..engine.errors import LimitExceededError
from .calls import Calls, Context
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
        behave = _streaming if any(streams) else _unary
        handlers[method.name] = MAKERS[streams](
            behave(method.name, getattr(service, method.name), calls),
            request_deserializer=_message_or_error(GetMessageClass(method.input_type), calls.max_message_bytes),
            response_serializer=GetMessageClass(method.output_type).SerializeToString,
        )
    return grpc.method_handlers_generic_handler(DESCRIPTOR.full_name, handlers)


def _unary(name: str, method: Callable[..., Awaitable[Message]], calls: Calls) -> Callable[..., Awaitable[Message]]:
    until_drain = calls.short if name in FINISHED else calls.cutoff

    async def behave(request: Any, context: Context) -> Message:
        async with calls.enter(name, context, request, stream=False) as call:
            with until_drain():
                response = await method(request, call)
            call.check_size(response)
            return response

    return behave


def _streaming(name: str, method: Callable[..., Awaitable[Any]], calls: Calls) -> Callable[..., Awaitable[Any]]:
    async def behave(request: Any, context: Context) -> Any:
        async with calls.enter(name, context, request, stream=True) as call:
            return await method(request, call)

    return behave


def _message_or_error(kind: type[Message], max_bytes: int) -> Callable[[bytes], Message | Exception]:
    """A deserializer that returns what is wrong: what it raised, gRPC would answer with UNKNOWN."""

    def deserialize(data: bytes) -> Message | Exception:
        if len(data) > max_bytes:
            return LimitExceededError("max_message_bytes", max_bytes)
        try:
            return kind.FromString(data)
        except DecodeError as error:
            return error

    return deserialize
