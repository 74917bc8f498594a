import grpc

from dynhull_proto.v1 import hull_service_pb2
from dynhull_surface.services import Stub, adder_of, servicer_of


class HullServiceStub(Stub):
    service = hull_service_pb2.DESCRIPTOR.services_by_name["HullService"]


HullServiceServicer = servicer_of(HullServiceStub.service, grpc)
add_HullServiceServicer_to_server = adder_of(HullServiceStub.service, grpc)
