"""The status of a refused call."""

from collections.abc import Callable

import grpc
import pytest
from google.rpc.error_details_pb2 import BadRequest, ErrorInfo, PreconditionFailure, QuotaFailure, ResourceInfo
from grpc_status import rpc_status


def refusal(call: Callable[[], object]) -> tuple[grpc.StatusCode, ErrorInfo, list[object]]:
    """The code, the ErrorInfo and the other details of a call that must fail."""
    with pytest.raises(grpc.RpcError) as caught:
        call()
    status = rpc_status.from_call(caught.value)
    assert status is not None, caught.value
    types = (ErrorInfo, BadRequest, ResourceInfo, PreconditionFailure, QuotaFailure)
    details = []
    for packed in status.details:
        (kind,) = (each for each in types if packed.Is(each.DESCRIPTOR))
        detail = kind()
        packed.Unpack(detail)
        details.append(detail)
    assert isinstance(details[0], ErrorInfo)
    assert details[0].domain == "dynhull.v1"
    return caught.value.code(), details[0], details[1:]
