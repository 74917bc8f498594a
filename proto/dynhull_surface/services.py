"""What gRPC has for a service, made of its descriptor, where protoc writes out each method five times.

`make proto` writes the modules that have it, and its types. They bring gRPC along: nothing is imported here.
"""

from typing import Any


class Stub:
    """A callable for each method of a service; its subclasses name the service."""

    service: Any

    def __init__(self, channel: Any) -> None:
        for method in self.service.methods:
            call = getattr(channel, _kind(method))(
                f"/{self.service.full_name}/{method.name}",
                request_serializer=method.input_type._concrete_class.SerializeToString,
                response_deserializer=method.output_type._concrete_class.FromString,
                _registered_method=True,
            )
            setattr(self, method.name, call)


def servicer_of(service: Any, grpc: Any) -> type:
    """The base class of those who implement it, which refuses each method."""

    def refuse(_: Any, __: Any, context: Any) -> None:
        context.set_code(grpc.StatusCode.UNIMPLEMENTED)
        context.set_details("Method not implemented!")
        raise NotImplementedError("Method not implemented!")

    return type(f"{service.name}Servicer", (), {method.name: refuse for method in service.methods})


def adder_of(service: Any, grpc: Any) -> Any:
    """The function that adds one who implements it to a server."""

    def add(servicer: Any, server: Any) -> None:
        handlers = {
            method.name: getattr(grpc, f"{_kind(method)}_rpc_method_handler")(
                getattr(servicer, method.name),
                request_deserializer=method.input_type._concrete_class.FromString,
                response_serializer=method.output_type._concrete_class.SerializeToString,
            )
            for method in service.methods
        }
        server.add_generic_rpc_handlers((grpc.method_handlers_generic_handler(service.full_name, handlers),))
        server.add_registered_method_handlers(service.full_name, handlers)

    return add


def _kind(method: Any) -> str:
    """As gRPC calls it: unary_unary, unary_stream, ..."""
    return "_".join("stream" if streams else "unary" for streams in (method.client_streaming, method.server_streaming))
