"""HullService: what dynhull.v1 promises, a method an RPC. The contract documents the methods."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import aclosing

from google.protobuf.message import DecodeError

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import hull_service_pb2_grpc

from ..engine.hulls import Engine
from ..engine.live_hull import LiveHull
from ..engine.watch import watch
from . import codec
from .calls import Calls, Context


class HullService(hull_service_pb2_grpc.HullServiceServicer):
    """The service on an engine.

    Where `request` is a DecodeError instead, entering the call raises it.
    """

    def __init__(self, engine: Engine, calls: Calls) -> None:
        self._engine = engine
        self._calls = calls

    async def CreateHull(self, request: pb.CreateHullRequest, context: Context) -> pb.CreateHullResponse:
        async with self._calls.short(context, request):
            name = codec.decode_name(request.name)
            codec.decode_config(request.config)
            hull = self._engine.create(name)
            return pb.CreateHullResponse(hull=codec.encode_hull(hull, hull.counts))

    async def DeleteHull(self, request: pb.DeleteHullRequest, context: Context) -> pb.DeleteHullResponse:
        async with self._calls.short(context, request):
            self._engine.delete(codec.decode_name(request.name))
            return pb.DeleteHullResponse()

    async def ListHulls(self, request: pb.ListHullsRequest, context: Context) -> pb.ListHullsResponse:
        async with self._calls.short(context, request):
            prefix, after, size = codec.decode_page(request)
            hulls, more = self._engine.page(prefix, after, size)
            return pb.ListHullsResponse(
                hulls=[codec.encode_hull(hull, hull.counts) for hull in hulls],
                next_page_token=hulls[-1].name if more else "",
            )

    async def Apply(self, request: pb.ApplyRequest, context: Context) -> pb.ApplyResponse:
        async with self._calls.short(context, request):
            hull = self._hull(request.name)
            if not request.HasField("batch"):
                raise codec.InvalidFieldError("batch", "", "a batch is required")
            applied = await hull.apply(codec.decode_batch(request.batch))
            return pb.ApplyResponse(result=codec.encode_applied(applied))

    async def Ingest(self, requests: AsyncIterator[pb.IngestRequest], context: Context) -> pb.IngestResponse:
        async with self._calls.waiting(context, requests) as progress:
            hull: LiveHull | None = None
            summary = pb.IngestResponse()
            progress.batches = 0
            async for request in requests:
                if isinstance(request, DecodeError):
                    raise request
                if hull is None:
                    hull = self._hull(request.name)
                    summary.revision, summary.point_count = hull.counts.revision, hull.counts.points
                elif request.name not in ("", hull.name):
                    raise codec.InvalidFieldError("name", request.name, f"this call writes to {hull.name!r}")
                if not request.HasField("batch"):
                    continue
                applied = await hull.apply(codec.decode_batch(request.batch))
                progress.batches += 1
                summary.inserted += applied.inserted
                summary.deleted += applied.deleted
                summary.missing += applied.missing
                summary.revision, summary.point_count = applied.revision, applied.points
            if hull is None:
                raise codec.InvalidFieldError("name", "", "the first message names the hull, and there was none")
            summary.batches = progress.batches
            return summary

    async def Locate(self, request: pb.LocateRequest, context: Context) -> pb.LocateResponse:
        async with self._calls.waiting(context, request):
            hull = self._hull(request.name)
            counts, sides = await hull.locate(codec.decode_points(request.points, "points"), request.min_revision)
            return pb.LocateResponse(revision=counts.revision, sides=sides.tobytes())

    async def GetHull(self, request: pb.GetHullRequest, context: Context) -> pb.GetHullResponse:
        async with self._calls.waiting(context, request):
            hull = self._hull(request.name)
            encoding = codec.decode_encoding(request.encoding)
            counts, vertices = await hull.vertices(request.min_revision)
            measures = await asyncio.to_thread(codec.encode_measures, vertices)
            return pb.GetHullResponse(
                hull=codec.encode_hull(hull, counts),
                vertices=codec.encode_points(vertices, encoding),
                measures=measures,
            )

    async def Watch(self, request: pb.WatchRequest, context: Context) -> AsyncIterator[pb.WatchResponse]:
        async with self._calls.streaming(context, request):
            hull = self._hull(request.name)
            encoding = codec.decode_encoding(request.encoding)
            min_interval = codec.decode_rate(request.max_events_per_second)
            progress_interval = codec.decode_interval(request)
            async with aclosing(watch(hull, request.min_revision, min_interval, progress_interval)) as events:
                while True:
                    async with self._calls.cutoff():
                        event = await anext(events)
                        message = await asyncio.to_thread(codec.encode_event, event, encoding, request.include_measures)
                    yield message

    async def Verify(self, request: pb.VerifyRequest, context: Context) -> pb.VerifyResponse:
        async with self._calls.waiting(context, request):
            hull = self._hull(request.name)
            encoding = codec.decode_encoding(request.encoding)
            return codec.encode_verification(*await hull.verify(request.min_revision), encoding)

    def _hull(self, name: str) -> LiveHull:
        return self._engine.get(codec.decode_name(name))
