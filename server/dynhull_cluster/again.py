"""Which requests may be sent again to the next owner of a hull, if the one before has not answered them."""

from typing import Any

import grpc
from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.rpc.methods import DESCRIPTOR, FINISHED, LISTS, OWN_SERVICES
from dynhull_surface.reasons import NOT_BEGUN

READS = {
    f"/{service.full_name}/{method.name}"
    for service in OWN_SERVICES
    for method in service.methods
    if method.name not in FINISHED - LISTS and (not method.client_streaming or method.name == "Query")
}


def may_repeat(method: str, message: bytes, status: Status) -> bool:
    """Whether a request may be repeated after this status: it has not begun, or a second time has no effect."""
    if status.code != grpc.StatusCode.UNAVAILABLE.value[0]:
        return False
    reason = reason_of(status)
    if reason in NOT_BEGUN:
        return True
    if reason:  # it is known what has become of it
        return False
    return method in READS or (method in NUMBERED and _is_numbered(NUMBERED[method].FromString(message)))


def has_not_begun(status: Status) -> bool:
    """Whether a request has certainly not begun."""
    return reason_of(status) in NOT_BEGUN


def may_have_begun(method: str, status: Status) -> bool:
    """Whether a request may have taken effect, though it has ended with this status."""
    return method not in READS and status.code == grpc.StatusCode.UNAVAILABLE.value[0] and not reason_of(status)


def _is_numbered(request: Any) -> bool:
    """Whether a batch has a number, by which a server knows that it has applied it."""
    return bool(request.producer and request.sequence)


def reason_of(status: Status) -> str:
    """The reason that a server gives its refusal; empty for none."""
    for detail in status.details:
        info = ErrorInfo()
        if detail.Unpack(info):
            return str(info.reason)
    return ""


NUMBERED: dict[str, Any] = {
    f"/{DESCRIPTOR.full_name}/Apply": pb.ApplyRequest,
    f"/{DESCRIPTOR.full_name}/ApplyTogether": pb.ApplyTogetherRequest,
}
