import grpc

from dynhull_proto.v1 import alarm_service_pb2
from dynhull_surface.services import Stub, adder_of, servicer_of


class AlarmServiceStub(Stub):
    service = alarm_service_pb2.DESCRIPTOR.services_by_name["AlarmService"]


AlarmServiceServicer = servicer_of(AlarmServiceStub.service, grpc)
add_AlarmServiceServicer_to_server = adder_of(AlarmServiceStub.service, grpc)
