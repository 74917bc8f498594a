import grpc

from dynhull_proto.v1 import fence_service_pb2
from dynhull_surface.services import Stub, adder_of, servicer_of


class FenceServiceStub(Stub):
    service = fence_service_pb2.DESCRIPTOR.services_by_name["FenceService"]


FenceServiceServicer = servicer_of(FenceServiceStub.service, grpc)
add_FenceServiceServicer_to_server = adder_of(FenceServiceStub.service, grpc)
