"""The handlers of all methods for gRPC: each is made by `Calls.handler`, and refuses bytes that are no message.

All of them are stream handlers, even those of single messages: gRPC reads the message of a unary call before it calls
the handler, so callers without permission could fill the memory.
"""

from collections.abc import Awaitable, Callable, Collection, Mapping
from contextlib import aclosing
from typing import Any, NamedTuple

import grpc
from google.protobuf.descriptor import MethodDescriptor, ServiceDescriptor
from google.protobuf.message import DecodeError, Message
from google.protobuf.message_factory import GetMessageClass
from grpc_health.v1 import health_pb2
from grpc_reflection.v1alpha import reflection, reflection_pb2

from dynhull_proto.v1 import alarm_service_pb2, fence_service_pb2, hull_service_pb2

from ..state.errors import LimitExceededError
from . import short_batches
from .access import Access
from .alarm_service import AlarmService
from .calls import Call, Calls, Context, Received, UnaryHandler, Work
from .fence_service import FenceService
from .health import MAX_BYTES, Health
from .hull_service import HullService
from .query import METHODS
from .runs import RUNS, Run
from .status import ANSWERED, MethodUnknownError

DESCRIPTOR = hull_service_pb2.DESCRIPTOR.services_by_name["HullService"]
FENCES = fence_service_pb2.DESCRIPTOR.services_by_name["FenceService"]
ALARMS = alarm_service_pb2.DESCRIPTOR.services_by_name["AlarmService"]
# All that serve hulls, fences and alarms.
OWN_SERVICES = DESCRIPTOR, FENCES, ALARMS
HEALTH = health_pb2.DESCRIPTOR.services_by_name["Health"]
REFLECTION = reflection_pb2.DESCRIPTOR.services_by_name["ServerReflection"]

# A draining server lets these calls finish, and cuts off the others.
FINISHED = {
    "CreateHull",
    "DeleteHull",
    "Recenter",
    "SetQuarantine",
    "Reshard",
    "SetHistory",
    "EraseHistory",
    "ListHulls",
    "Apply",
    "ApplyTogether",
    "CreateFence",
    "ReplaceFence",
    "DeleteFence",
    "ListFences",
    "AckFeed",
    "DeleteFeedConsumer",
    "AckFence",
    "DeleteConsumer",
    "CreateAlarm",
    "DeleteAlarm",
    "ListAlarms",
    "AckAlarm",
    "DeleteAlarmConsumer",
    "AcknowledgeAlarm",
    "MuteAlarm",
}

# Those of them that change nothing.
LISTS = {"ListHulls", "ListFences", "ListAlarms"}

# The name of all unknown methods in the counts of calls.
UNKNOWN_METHOD = "unknown"

Behave = Callable[[Any, Call], Awaitable[Any]]
# The serialized response to a serialized request; None for one that `Behave` answers.
Short = Callable[[bytes, Access], bytes | None]


class RunHandler(NamedTuple):
    """What answers runs of calls, and the kind of read that these are."""

    kind: str
    handle: Callable[[object, Any], Awaitable[Any]]


def hull_handlers(service: HullService, calls: Calls) -> grpc.GenericRpcHandler:
    """The handlers of the hull service."""
    return _own_handlers(DESCRIPTOR, service, calls, service.short)


def fence_handlers(service: FenceService, calls: Calls) -> grpc.GenericRpcHandler:
    """The handlers of the fence service."""
    return _own_handlers(FENCES, service, calls)


def alarm_handlers(service: AlarmService, calls: Calls) -> grpc.GenericRpcHandler:
    """The handlers of the alarm service."""
    return _own_handlers(ALARMS, service, calls)


def run_handlers(service: HullService, calls: Calls) -> dict[str, RunHandler]:
    """What answers runs of calls, by the path of their method: for what serves several calls at a time.

    The request is a Run, and the answer has the serialized response to each call. A refused run is not counted: each of
    its calls has to be answered by itself, because one may be at fault, or all.
    """
    found = {}
    for kind in RUNS:
        method = METHODS[kind]
        handle = calls.handler(method, calls.admit, _run(_read(getattr(service, method))))
        found[f"/{DESCRIPTOR.full_name}/{method}"] = RunHandler(kind, handle)
    return found


def health_handlers(health: Health, calls: Calls) -> grpc.GenericRpcHandler:
    """The handlers of the health service, which needs no token."""
    works = {"Check": health.check, "Watch": health.watch}
    return _handlers(HEALTH, works, f"{HEALTH.full_name}/", calls, calls.admit_anybody, MAX_BYTES)


def reflection_handlers(calls: Calls) -> grpc.GenericRpcHandler:
    """The handlers of reflection, which describes all services."""
    services = [each.full_name for each in (*OWN_SERVICES, HEALTH, REFLECTION)]
    servicer = reflection.aio.ReflectionServicer(services)

    async def describe(call: Call) -> None:
        with call.stream():
            async with aclosing(servicer.ServerReflectionInfo(call.messages(), None)) as responses:
                async for response in responses:
                    await call.write(response)

    works = {"ServerReflectionInfo": describe}
    return _handlers(REFLECTION, works, f"{REFLECTION.full_name}/", calls, calls.admit, calls.max_message_bytes)


class UnknownMethods(grpc.GenericRpcHandler):
    """Refuses and counts all other methods."""

    def __init__(self, calls: Calls) -> None:
        refuse = calls.handler(UNKNOWN_METHOD, calls.admit, _refuse_method)
        self._handler: Any = grpc.stream_stream_rpc_method_handler(refuse)

    def service(self, _: grpc.HandlerCallDetails) -> Any:
        """The handler, the same for all methods."""
        return self._handler


async def _refuse_method(_: Call) -> None:
    raise MethodUnknownError


def _own_handlers(
    descriptor: ServiceDescriptor,
    service: HullService | FenceService | AlarmService,
    calls: Calls,
    short: Mapping[str, Short] | None = None,
) -> grpc.GenericRpcHandler:
    works, short = {}, short or {}
    for method in descriptor.methods:
        behave = getattr(service, method.name)
        if method.client_streaming or method.server_streaming:
            works[method.name] = _streaming(method, behave)
        elif method.name in short:
            received = _received(GetMessageClass(method.input_type), calls.max_message_bytes)
            works[method.name] = _shortened(short[method.name], received, _read(behave))
        else:
            works[method.name] = _unary(method, behave if method.name in FINISHED - LISTS else _read(behave))
    return _handlers(descriptor, works, "", calls, calls.admit, calls.max_message_bytes, short)


def _handlers(
    service: ServiceDescriptor,
    works: Mapping[str, Work],
    prefix: str,
    calls: Calls,
    admit: Callable[[Context], Call],
    max_bytes: int,
    short: Collection[str] = (),
) -> grpc.GenericRpcHandler:
    handlers = {}
    for method in service.methods:
        if method.name not in works:  # only a newer release of the service has it
            continue
        make: Callable[..., Any] = grpc.stream_unary_rpc_method_handler
        if method.server_streaming:
            make = grpc.stream_stream_rpc_method_handler
        received: Callable[[bytes], Any] = _received(GetMessageClass(method.input_type), max_bytes)
        if method.name in short:
            received = bytes
        elif method.input_type is hull_service_pb2.StreamRequest.DESCRIPTOR:
            received = short_batches.received(received)
        handle: Any = calls.handler(prefix + method.name, admit, works[method.name])
        if not method.server_streaming:
            handle = UnaryHandler(handle)
        handlers[method.name] = make(handle, request_deserializer=received)
    return grpc.method_handlers_generic_handler(service.full_name, handlers)


def _read(behave: Behave) -> Behave:
    """A read, whose answer does not leave if another server may have other hulls meanwhile: this one may have slept."""

    async def answer(request: Any, call: Call) -> Any:
        try:
            response = await behave(request, call)
        except ANSWERED:
            call.require_entitled()
            raise
        call.require_entitled()
        return response

    return answer


def _run(behave: Behave) -> Work:
    async def answer(call: Call) -> list[bytes]:
        run: Run = await call.receive()
        call.counted = 0
        with call.cutoff():
            response = await behave(run.request, call)
        call.counted = run.length
        return run.responses(response)

    return answer


def _unary(method: MethodDescriptor, behave: Behave) -> Work:
    if method.name not in FINISHED:

        async def wait(call: Call) -> bytes:
            with call.cutoff():
                response = await behave(await call.receive(), call)
            return call.serialize(response)

        return wait

    async def finish(call: Call) -> bytes:
        with call.cutoff():
            request = await call.receive()
        call.finish()
        response = await behave(request, call)
        return call.serialize(response)

    return finish


def _shortened(short: Short, received: Callable[[bytes], Received], behave: Behave) -> Work:
    """A read that is answered the short way where that is one for it."""

    async def answer(call: Call) -> bytes:
        with call.cutoff():
            data: bytes = await call.receive_any()
            found = short(data, call.caller.access)
            if found is not None:
                call.require_entitled()
                return found
            response = await behave(call.take(received(data)), call)
        return call.serialize(response)

    return answer


def _streaming(method: MethodDescriptor, behave: Behave) -> Work:
    async def work(call: Call) -> bytes | None:
        with call.stream():
            request = None
            if not method.client_streaming:
                with call.cutoff():
                    request = await call.receive()
            response = await behave(request, call)
        return None if response is None else call.serialize(response)

    return work


def _received(kind: type[Message], max_bytes: int) -> Callable[[bytes], Received]:
    """A deserializer that returns errors, because gRPC answers raised ones with UNKNOWN."""

    def deserialize(data: bytes) -> Received:
        if len(data) > max_bytes:
            return LimitExceededError("max_message_bytes", max_bytes)
        try:
            return kind.FromString(data), len(data)
        except DecodeError as error:
            return error

    return deserialize
