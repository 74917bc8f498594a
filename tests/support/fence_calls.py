"""Calls of a server with fences, as tests make them, and events in words."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import grpc
from patience import PATIENCE
from refusal import refusal

from dynhull_proto.v1 import batch_pb2, fence_pb2, points_pb2
from dynhull_proto.v1 import fence_service_pb2 as fs
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub


def points(*xy: float) -> points_pb2.Points:
    return points_pb2.Points(coordinates=xy)


def puts(**positions: tuple[float, float]) -> batch_pb2.Batch:
    return batch_pb2.Batch(
        puts=batch_pb2.Puts(
            keys=points_pb2.Keys(strings=positions), points=points(*(c for p in positions.values() for c in p))
        )
    )


def put(stub: HullServiceStub, hull: str, **positions: tuple[float, float]) -> int:
    """Put keys; the revision."""
    return stub.Apply(pb.ApplyRequest(name=hull, batch=puts(**positions))).result.revision


def remove(stub: HullServiceStub, hull: str, *keys: str) -> None:
    stub.Apply(pb.ApplyRequest(name=hull, batch=batch_pb2.Batch(removes=points_pb2.Keys(strings=keys))))


def insert(stub: HullServiceStub, hull: str, *xy: float) -> int:
    return stub.Apply(pb.ApplyRequest(name=hull, batch=batch_pb2.Batch(inserts=points(*xy)))).result.revision


def delete(stub: HullServiceStub, hull: str, *xy: float) -> None:
    stub.Apply(pb.ApplyRequest(name=hull, batch=batch_pb2.Batch(deletes=points(*xy))))


def polygon(*rings: Sequence[float]) -> fence_pb2.PolygonArea:
    exterior, *holes = rings
    return fence_pb2.PolygonArea(
        polygons=[fence_pb2.Polygon(exterior=points(*exterior), holes=[points(*hole) for hole in holes])]
    )


def create(fences: FenceServiceStub, fence: str, **config: object) -> fence_pb2.Fence:
    return fences.CreateFence(fs.CreateFenceRequest(name=fence, config=config)).fence


def events(fences: FenceServiceStub, fence: str, after: int = 0) -> list[fence_pb2.FenceEvent]:
    """All events after a sequence."""
    last = fences.GetFence(fs.GetFenceRequest(name=fence)).fence.last_sequence
    watch = fences.WatchFence(fs.WatchFenceRequest(name=fence, after_sequence=after), timeout=PATIENCE)
    found: list[fence_pb2.FenceEvent] = []
    reached = after
    for response in watch:
        found += response.events
        reached = response.sequence
        if reached >= last:
            break
    watch.cancel()
    assert [event.sequence for event in found] == list(range(after + 1, reached + 1))
    return found


def told(event: fence_pb2.FenceEvent) -> str:
    """An event in words: its type, key and causes."""
    kind = fence_pb2.FenceEventType.Name(event.type).removeprefix("FENCE_EVENT_TYPE_")
    causes = [fence_pb2.FenceCause.Name(cause).removeprefix("FENCE_CAUSE_") for cause in event.causes]
    return " ".join([kind, event.string_key, *causes]).replace("  ", " ")


def inside(fences: FenceServiceStub, fence: str) -> list[str]:
    parts = fences.ReadInside(fs.ReadInsideRequest(name=fence))
    keys = []
    for part in parts:
        for each in part.subjects:
            text = each.keys.text.decode()
            start = 0
            for length in each.keys.lengths:
                keys.append(text[start : start + length])
                start += length
    return keys


@dataclass(frozen=True)
class Refused:
    code: grpc.StatusCode
    reason: str
    metadata: Mapping[str, str]


def refused_by(method: Callable[..., object], request: object) -> Refused:
    code, info, _ = refusal(lambda: method(request))
    return Refused(code, info.reason, dict(info.metadata))
