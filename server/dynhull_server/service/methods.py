"""The service's methods as gRPC wants them, but for what it does with bytes that are no message."""

from collections.abc import Callable
from typing import Any

import grpc
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass

from dynhull_proto.v1 import hull_service_pb2

from .hull_service import HullService

DESCRIPTOR = hull_service_pb2.DESCRIPTOR.services_by_name["HullService"]
HANDLERS: dict[tuple[bool, bool], Callable[..., Any]] = {
    (False, False): grpc.unary_unary_rpc_method_handler,
    (False, True): grpc.unary_stream_rpc_method_handler,
    (True, False): grpc.stream_unary_rpc_method_handler,
    (True, True): grpc.stream_stream_rpc_method_handler,
}


def method_handlers(service: HullService) -> grpc.GenericRpcHandler:
    """The service for `Server.add_generic_rpc_handlers`.

    The generated registration would answer bytes that are no message with UNKNOWN. Here the method gets the DecodeError
    in place of the message.
    """
    handlers = {}
    for method in DESCRIPTOR.methods:
        make = HANDLERS[method.client_streaming, method.server_streaming]
        handlers[method.name] = make(
            getattr(service, method.name),
            request_deserializer=_message_or_error(GetMessageClass(method.input_type)),
            response_serializer=GetMessageClass(method.output_type).SerializeToString,
        )
    return grpc.method_handlers_generic_handler(DESCRIPTOR.full_name, handlers)


def _message_or_error(kind: type[Message]) -> Callable[[bytes], Message | DecodeError]:
    def deserialize(data: bytes) -> Message | DecodeError:
        try:
            return kind.FromString(data)
        except DecodeError as error:
            return error

    return deserialize
