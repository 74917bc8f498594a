"""HullService, one method per RPC of dynhull.v1. The .proto files document the methods."""

import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from typing import Any

import numpy as np

from dynhull.arrays import Checked
from dynhull.keys import key_list
from dynhull_proto.v1 import feed_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

from ..engine import entities
from ..engine.driver import Driver
from ..engine.entities import KeyAnswers, Question
from ..engine.hulls import Hulls
from ..engine.live_hull import LiveHull
from ..engine.roster import Roster
from ..engine.steps import FEW_ROWS, Run, at_once
from ..engine.views import Event, ResumedView
from ..engine.watch import watch
from ..engine.watch_many import ManyPart, watch_many
from ..state.errors import (
    HullEmptyError,
    HullFencedError,
    HullReplacedError,
    LimitExceededError,
    PartRefusedError,
)
from ..state.frames import require_lines, require_reach
from ..state.records import Contents
from . import answers, decode, encode
from .calls import Call
from .decode_batch import decode_keys
from .decode_feed import decode_feed_choice
from .decode_moment import decode_moment
from .decode_replay import decode_view
from .decode_settings import decode_center, decode_history, decode_quarantine, decode_settings, decode_shards
from .feeds import BatchFeeds
from .many import MANY_INTERVAL, HullStates, ManyQuotas, encode_many, require_many
from .metrics import Metrics
from .outgoing import Counted, send_each
from .places import Places
from .query import METHODS, Answers
from .readings import ENTRIES, RISKS
from .replays import Replays
from .short_batches import PointsMessage, PutsMessage, acknowledgement, acknowledgements
from .short_locates import ShortLocates
from .status import ANSWERED
from .tracks import Tracks
from .vertex_pages import VertexPages, page_token
from .writing import (
    MOST_IN_A_MESSAGE,
    StreamedBatches,
    decode_together,
    decode_write,
    decoding,
    gap_explained,
    require_present,
)

# The side of a missing key.
MISSING_SIDE = -128
# The number of points in a part of all points, so that none exceeds the 4 MiB that gRPC receives by default.
POINTS_A_PART = 8_192


class HullService:
    """The service.

    Args:
        driver: drives the core that has the hulls.
        hulls: the hulls.
        metrics: counts the work.
        quotas: how much a caller may watch of many hulls.
        pasts: limits the reads of the past at a time.
        replays: limits the replays at a time.
        feeds: limits the feeds at a time.
        create_on_write: whether a write to a missing hull creates it.
        max_watch_lag: the seconds that a watcher may take to receive an event.

    Attributes:
        short: short ways to answer requests, by method.
    """

    def __init__(
        self,
        driver: Driver,
        hulls: Hulls,
        metrics: Metrics,
        quotas: ManyQuotas,
        pasts: Places,
        replays: Places,
        feeds: Places,
        *,
        create_on_write: bool,
        max_watch_lag: float,
    ) -> None:
        self._hulls = hulls
        self._pasts = pasts
        self._replays = Replays(hulls, replays, driver.aside, max_watch_lag)
        self._tracks = Tracks(hulls, pasts, max_watch_lag)
        self._feeds = BatchFeeds(hulls, feeds, quotas.roster, metrics, max_watch_lag)
        self._driver = driver
        self._aside = driver.aside
        self._metrics = metrics
        self._quotas = quotas
        self._create_on_write = create_on_write
        self._max_watch_lag = max_watch_lag
        self._pages = VertexPages(driver.machine.clock)
        self.short = {"Locate": ShortLocates(hulls).answer}
        self._queried = {kind: getattr(self, method) for kind, method in METHODS.items()}

    # Hulls

    async def CreateHull(self, request: pb.CreateHullRequest, call: Call) -> pb.CreateHullResponse:
        name = decode.decode_name(request.name)
        call.access.require_write(name)
        hull = await self._hulls.create(name, decode_settings(request.config))
        return pb.CreateHullResponse(hull=encode.encode_hull(hull, hull.counts))

    async def DeleteHull(self, request: pb.DeleteHullRequest, call: Call) -> pb.DeleteHullResponse:
        name = decode.decode_name(request.name)
        call.access.require_write(name)
        with _naming_fences(call):
            await self._hulls.delete(name)
        return pb.DeleteHullResponse()

    async def ListHulls(self, request: pb.ListHullsRequest, call: Call) -> pb.ListHullsResponse:
        prefix, after, size = decode.decode_page(request)
        hulls, more = self._hulls.page(call.access.readable(prefix), after, size)
        return pb.ListHullsResponse(
            hulls=[encode.encode_hull(hull, hull.counts) for hull in hulls],
            next_page_token=hulls[-1].name if more else "",
        )

    async def Recenter(self, request: pb.RecenterRequest, call: Call) -> pb.RecenterResponse:
        hull = self._hulls.get(self._written(call, request.name))
        center = decode_center(request.center, "center") if request.HasField("center") else None
        with _naming_fences(call):
            counts, hull_changed = await hull.recenter(center)
        return pb.RecenterResponse(hull=encode.encode_hull(hull, counts), hull_changed=hull_changed)

    async def SetQuarantine(self, request: pb.SetQuarantineRequest, call: Call) -> pb.SetQuarantineResponse:
        hull = self._hulls.get(self._written(call, request.name))
        counts = await hull.set_quarantine(decode_quarantine(request.quarantine, "quarantine"))
        return pb.SetQuarantineResponse(hull=encode.encode_hull(hull, counts))

    async def Reshard(self, request: pb.ReshardRequest, call: Call) -> pb.ReshardResponse:
        hull = self._hulls.get(self._written(call, request.name))
        counts = await hull.reshard(decode_shards(request.shards, "shards"))
        return pb.ReshardResponse(hull=encode.encode_hull(hull, counts))

    async def SetHistory(self, request: pb.SetHistoryRequest, call: Call) -> pb.SetHistoryResponse:
        name = self._written(call, request.name)
        kept = decode_history(request.history, "history") if request.HasField("history") else (0, 0)
        hull = await self._hulls.set_history(name, *kept)
        return pb.SetHistoryResponse(hull=encode.encode_hull(hull, hull.counts))

    async def GetHistory(self, request: pb.GetHistoryRequest, call: Call) -> pb.GetHistoryResponse:
        hull, found = await self._hulls.history(self._read(call, request.name).name)
        return encode.encode_found_history(hull, found)

    async def EraseHistory(self, request: pb.EraseHistoryRequest, call: Call) -> pb.EraseHistoryResponse:
        name = self._written(call, request.name)
        call.access.require_past(name)
        hull = self._hulls.get(name)
        keys = hull.keys(decode_keys(request.keys, "keys"))
        if not len(keys):
            raise decode.InvalidFieldError("keys", "", "at least one key is required")
        erasure = await self._hulls.filing.erase(hull, keys)
        return pb.EraseHistoryResponse(erasure=None if erasure is None else encode.encode_erasure(erasure))

    # Writes

    async def Apply(self, request: pb.ApplyRequest, call: Call) -> pb.ApplyResponse:
        begun = time.perf_counter()
        name = self._written(call, request.name)
        if not request.HasField("batch"):
            raise decode.InvalidFieldError("batch", "", "a batch is required")
        producer = decode.decode_producer(request.producer)
        may_skip = decode.decode_may_skip(producer, request.may_skip)
        owner = call.owner if producer else ""  # asking gRPC for the address takes longer than a batch of one point
        rows = call.message_bytes // decode.BYTES_PER_POINT  # an estimate: reading the points would copy them
        given = name, producer, owner, may_skip, request, self._driver.time(), rows
        write = await decoding(self._driver, rows, decode_write, *given)
        try:
            if request.uid and self._hulls.has(name):
                await require_present(self._hulls.get(name), producer, request.uid)
            applied = await self._hulls.apply(write, create=self._create_on_write)
        except Exception as error:
            self._metrics.batches.refused()
            raise gap_explained(error, self._hulls, name, request.uid) from None
        self._metrics.batches.applied(applied, time.perf_counter() - begun)
        response = pb.ApplyResponse()
        encode.encode_applied(applied, response.result)
        return response

    async def ApplyTogether(self, request: pb.ApplyTogetherRequest, call: Call) -> pb.ApplyTogetherResponse:
        begun = time.perf_counter()
        for name in decode.decode_parts(request):
            call.access.require_write(name)
        rows = call.message_bytes // decode.BYTES_PER_POINT
        writes = await decoding(self._driver, rows, decode_together, request, self._driver.time(), call.owner)
        try:
            for index, each in enumerate(request.batches):
                if each.uid and self._hulls.has(each.name):
                    try:
                        await require_present(self._hulls.get(each.name), request.producer, each.uid)
                    except ANSWERED as error:
                        raise PartRefusedError(index, error) from None
            results = await self._hulls.apply_together(writes, rows)
        except PartRefusedError as refusal:
            if not isinstance(refusal.reason, ANSWERED):
                raise refusal.reason from None
            self._metrics.batches.refused()
            part = request.batches[refusal.index]
            reason = gap_explained(refusal.reason, self._hulls, part.name, part.uid)
            raise PartRefusedError(refusal.index, reason) from None
        except ANSWERED:
            self._metrics.batches.refused()
            raise
        response = pb.ApplyTogetherResponse()
        for applied in results:
            self._metrics.batches.applied(applied, time.perf_counter() - begun)
            encode.encode_applied(applied, response.results.add())
        return response

    async def Ingest(self, _: object, call: Call) -> pb.IngestResponse:
        call.batches = 0
        summary = pb.IngestResponse()
        with await self._batches(call) as streamed:
            if self._hulls.has(streamed.name):
                counts = self._hulls.get(streamed.name).counts
                summary.revision, summary.point_count = counts.revision, counts.points
            while await streamed.more():
                for _, applied in streamed.applied():
                    call.batches += 1
                    summary.duplicates += applied.duplicate
                    encode.add_counts(applied, summary)
                    summary.revision, summary.point_count = applied.revision, applied.points
        summary.batches = call.batches - summary.duplicates
        return summary

    async def Stream(self, _: object, call: Call) -> None:
        call.batches = 0
        with await self._batches(call) as streamed:
            if streamed.several:
                most_bytes = call.max_message_bytes
                await call.write(pb.StreamResponse(max_batches=MOST_IN_A_MESSAGE, max_message_bytes=most_bytes))
            while await streamed.more():
                if streamed.several:
                    outcomes = list(streamed.applied())
                    call.batches += len(outcomes)
                    await call.write(acknowledgements(outcomes, call.max_message_bytes))
                    continue
                for sequence, applied in streamed.applied():
                    call.batches += 1
                    await call.write(acknowledgement(sequence, applied))

    async def GetProducer(self, request: pb.GetProducerRequest, call: Call) -> pb.GetProducerResponse:
        name = decode.decode_name(request.name)
        call.access.require_write(name)
        if not request.producer:
            raise decode.InvalidFieldError("producer", "", "a producer is required")
        producer = decode.decode_producer(request.producer)
        hull = self._hulls.get(name)
        await require_present(hull, producer, request.uid)
        return pb.GetProducerResponse(last_sequence=await hull.last_sequence(producer), uid=hull.uid)

    # Reads

    async def Locate(self, request: pb.LocateRequest, call: Call) -> pb.LocateResponse:
        hull = await self._read_at(call, request)
        if decode.decode_subjects(request):
            found = await self._ask_of_keys(request, call, hull, lambda live, xy: live.locate(xy))
            found.rows[found.missing] = MISSING_SIDE
            return pb.LocateResponse(
                revision=found.counts.revision, sides=found.rows.tobytes(), keys_revision=_keys_revision(found)
            )
        xy = _places(hull, request.points)
        counts, sides = await hull.ask_rows(
            lambda live, rows: live.locate(xy[rows]), len(xy), request.min_revision, layer=decode.decode_layer(request)
        )
        return pb.LocateResponse(revision=counts.revision, sides=sides.tobytes())

    async def Count(self, request: pb.CountRequest, call: Call) -> pb.CountResponse:
        hull = await self._read_at(call, request)
        xy = _places(hull, request.points)
        counts, times = await hull.count(xy, request.min_revision)
        return pb.CountResponse(revision=counts.revision, counts=times)

    async def GetPositions(self, request: pb.GetPositionsRequest, call: Call) -> pb.GetPositionsResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        keys = hull.keys(decode_keys(request.keys, "keys"))
        counts, found = await entities.positions(hull, keys, request.min_revision)
        run = self._run(len(keys))
        response: pb.GetPositionsResponse = await run(partial(encode.encode_positions, counts, found, encoding))
        return response

    async def ReadEntities(self, request: pb.ReadEntitiesRequest, call: Call) -> None:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        hull.require_keys("name")
        with call.cutoff():
            counts, contents = await entities.entities(hull, request.min_revision)
        for rows in _parts(contents):
            with call.cutoff():
                part = await self._aside(partial(encode.encode_entities, counts, contents, rows, encoding))
            await call.write_within(self._max_watch_lag, part)

    async def ReadPoints(self, request: pb.ReadPointsRequest, call: Call) -> None:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        with call.cutoff():
            counts, contents = await entities.contents(hull, request.min_revision)
        for rows in _parts(contents):
            with call.cutoff():
                part = await self._aside(partial(encode.encode_part, counts, contents, rows, encoding))
            if not rows.start:
                part.hull.CopyFrom(encode.encode_hull(hull, counts))
            await call.write_within(self._max_watch_lag, part)

    async def ListHeld(self, request: pb.ListHeldRequest, call: Call) -> pb.ListHeldResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        hull.require_keys("name")
        after, size = decode.decode_held_page(request, strings=hull.settings.identity == "str")
        counts, held, more = await entities.held(hull, after, size, request.min_revision)
        token = str(key_list(held.keys)[-1]) if more else ""
        return encode.encode_held(counts, held, token, encoding)

    async def Support(self, request: pb.SupportRequest, call: Call) -> pb.SupportResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        directions, layer = Checked(decode.decode_directions(request.directions)), decode.decode_layer(request)
        if not request.include_keys:
            counts, extremes = await hull.support(directions, request.min_revision, layer)
            return pb.SupportResponse(revision=counts.revision, vertices=encode.encode_points(extremes, encoding))
        hull.require_keys("include_keys")
        counts, extremes, keys = await entities.support(hull, directions, request.min_revision, self._aside, layer)
        return pb.SupportResponse(
            revision=counts.revision,
            vertices=encode.encode_points(extremes, encoding),
            keys=encode.encode_key_array(keys, encoding),
        )

    async def Tangents(self, request: pb.TangentsRequest, call: Call) -> pb.TangentsResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        xy = _places(hull, request.points)
        counts, tangents = await hull.ask_rows(
            lambda live, rows: live.tangents(xy[rows]),
            len(xy),
            request.min_revision,
            layer=decode.decode_layer(request),
            check=lambda center: require_reach(center, "points", xy.points),
        )
        return pb.TangentsResponse(
            revision=counts.revision,
            left=encode.encode_points(np.ascontiguousarray(tangents[:, 0]), encoding),
            right=encode.encode_points(np.ascontiguousarray(tangents[:, 1]), encoding),
        )

    async def Distance(self, request: pb.DistanceRequest, call: Call) -> pb.DistanceResponse:
        hull = await self._read_at(call, request)
        if decode.decode_subjects(request):
            found = await self._ask_of_keys(request, call, hull, lambda live, xy: live.distance(xy))
            found.rows[found.missing] = np.nan
            return pb.DistanceResponse(
                revision=found.counts.revision, distances=found.rows, keys_revision=_keys_revision(found)
            )
        xy = _places(hull, request.points)
        counts, distances = await hull.ask_rows(
            lambda live, rows: live.distance(xy[rows]),
            len(xy),
            request.min_revision,
            layer=decode.decode_layer(request),
        )
        return pb.DistanceResponse(revision=counts.revision, distances=distances)

    async def IntersectLines(self, request: pb.IntersectLinesRequest, call: Call) -> pb.IntersectLinesResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        p, q = map(Checked, decode.decode_lines(request))
        if hull.geographic:
            decode.require_places(p.points, "origins")
            decode.require_places(q.points, "targets")
        counts, crossings = await hull.ask_rows(
            lambda live, rows: live.intersect_lines(p[rows], q[rows]),
            len(p),
            request.min_revision,
            layer=decode.decode_layer(request),
            check=lambda center: require_lines(center, p.points, q.points),
        )
        return pb.IntersectLinesResponse(
            revision=counts.revision,
            entries=encode.encode_points(np.ascontiguousarray(crossings[:, 0]), encoding),
            exits=encode.encode_points(np.ascontiguousarray(crossings[:, 1]), encoding),
        )

    async def GetHull(self, request: pb.GetHullRequest, call: Call) -> pb.GetHullResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        if not decode.decode_view(request.view):
            await hull.reached(request.min_revision)
            return pb.GetHullResponse(hull=encode.encode_hull(hull, hull.counts))
        found, page = await self._pages.read(hull, request, self._run)
        rows = slice(0, len(found.vertices)) if page is None else found.rows(page)
        response = pb.GetHullResponse(
            hull=encode.encode_hull(hull, found.counts),
            vertices=encode.encode_points(found.vertices[rows], encoding),
            vertex_keys=None if found.keys is None else encode.encode_keys(found.keys[rows], encoding),
        )
        if not rows.start:
            response.measures.CopyFrom(encode.encode_measures(await hull.measures(found.vertices)))
        if rows.stop < len(found.vertices):
            response.next_vertex_page_token = page_token(hull.uid, found.counts.revision, rows.stop)
        return response

    async def GetLayers(self, request: pb.GetLayersRequest, call: Call) -> pb.GetLayersResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        count = decode.decode_layer_count(request.layer_count)
        peeled = await hull.peeling.layers(count, request.min_revision)
        run = self._run(peeled.vertex_count)
        response: pb.GetLayersResponse = await run(
            partial(encode.encode_layers, peeled, encoding, keys=request.include_keys)
        )
        return response

    async def GetInfluence(self, request: pb.GetInfluenceRequest, call: Call) -> pb.GetInfluenceResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        counts, vertices, areas, keys = await hull.peeling.influence(request.min_revision)
        named = keys is not None and request.include_keys
        return pb.GetInfluenceResponse(
            revision=counts.revision,
            vertices=encode.encode_points(vertices, encoding),
            areas=areas,
            vertex_keys=encode.encode_key_array(keys, encoding) if named else None,
        )

    async def GetMeasures(self, request: pb.GetMeasuresRequest, call: Call) -> pb.GetMeasuresResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        counts, vertices = await hull.vertices(request.min_revision, decode.decode_layer(request))
        found = await hull.measures(vertices)
        run = self._run(len(vertices))
        return await answers.measures(counts, vertices, found, encoding, run, geographic=hull.geographic)

    async def GetSeries(self, request: pb.GetSeriesRequest, call: Call) -> pb.GetSeriesResponse:
        hull = self._read(call, request.name)
        encoding = decode.decode_encoding(request.encoding)
        kept = self._hulls.series
        series = await kept.read(hull, decode.decode_last(request))
        return encode.encode_series(hull, series, encoding, kept.interval if kept.seconds else 0)

    async def Separate(self, request: pb.SeparateRequest, call: Call) -> pb.SeparateResponse:
        hull, other = self._read(call, request.name), self._read(call, request.other_name, "other_name")
        encoding = decode.decode_encoding(request.encoding)
        other.require_frame_of(hull, "other_name")
        counts, other_counts, (vertices, other_vertices) = await hull.read_beside(
            other,
            lambda state, beside: (state.vertices(), beside.vertices()),
            (hull.vertex_count + other.vertex_count) // 2,
            request.min_revision,
            request.other_min_revision,
        )
        for each, found in ((hull, vertices), (other, other_vertices)):
            if not len(found):
                raise HullEmptyError(each.name)
        separation = answers.separation_on_globe if hull.geographic else answers.separation
        response: pb.SeparateResponse = await self._aside(
            lambda: separation(counts, vertices, other_counts, other_vertices, encoding)
        )
        return response

    async def PhaseDiagram(self, request: pb.PhaseDiagramRequest, call: Call) -> pb.PhaseDiagramResponse:
        hull = await self._read_at(call, request)
        hull.require_plane()
        encoding = decode.decode_encoding(request.encoding)
        entries = decode.decode_read(request.entries, "entries", ENTRIES)
        counts, vertices = await hull.vertices(request.min_revision)
        ENTRIES.require(hull.name, vertices)
        rows = len(vertices) + len(entries)
        return await answers.phase_diagram(counts, vertices, entries, encoding, self._run(rows))

    async def Frontier(self, request: pb.FrontierRequest, call: Call) -> pb.FrontierResponse:
        hull = await self._read_at(call, request)
        hull.require_plane()
        encoding = decode.decode_encoding(request.encoding)
        points = decode.decode_read(request.points, "points", RISKS)
        rates = decode.decode_rates(request.rates)
        counts, vertices = await hull.vertices(request.min_revision)
        RISKS.require(hull.name, vertices)
        if rates and not len(vertices):
            raise HullEmptyError(hull.name)
        rows = len(vertices) + len(points) + len(rates)
        return await answers.frontier(counts, vertices, points, rates, encoding, self._run(rows))

    async def Verify(self, request: pb.VerifyRequest, call: Call) -> pb.VerifyResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        counts, verification = await hull.verify(request.min_revision, tuple(call.access.readable("")))
        self._metrics.verified("call", verification.equal)
        return encode.encode_verification(counts, verification, encoding)

    async def SamplePoints(self, request: pb.SamplePointsRequest, call: Call) -> pb.SamplePointsResponse:
        hull = await self._read_at(call, request)
        encoding = decode.decode_encoding(request.encoding)
        size = decode.decode_sample_size(request.sample_size)
        if request.include_keys:
            hull.require_keys("include_keys")
            counts, points, keys = await entities.sample(hull, size, request.min_revision, self._aside)
            return pb.SamplePointsResponse(
                revision=counts.revision,
                points=encode.encode_points(points, encoding),
                keys=encode.encode_keys(keys, encoding),
            )
        counts, points = await hull.sample(size, request.min_revision)
        return pb.SamplePointsResponse(revision=counts.revision, points=encode.encode_points(points, encoding))

    async def Query(self, _: object, call: Call) -> None:
        answers = Answers(call, self._queried, self._hulls, self._metrics, self._max_watch_lag)
        async for message in call.messages():
            with call.cutoff():
                await answers.answer(message.reads)

    async def Watch(self, request: pb.WatchRequest, call: Call) -> None:
        hull = self._read(call, request.name)
        encoding = decode.decode_encoding(request.encoding)
        resume = decode.decode_resume(request)
        decode.decode_max_vertices(request, ("directions", "resume"))
        view = decode_view(request, hull)
        if resume is not None:
            view = ResumedView(hull, resume.uid, resume.revision, keys=request.include_keys)
        events = watch(
            hull,
            view,
            since=None if resume is None else resume.revision,
            min_revision=request.min_revision,
            min_interval=decode.decode_rate(request.max_events_per_second),
            progress_interval=decode.decode_interval(request),
            outline_only=request.outline_only,
        )
        measure = hull.measures if request.include_measures else None

        async def encoded(event: Event) -> pb.WatchResponse:
            message = await encode.encode_watched(event, encoding, self._aside, measure)
            encode.encode_changed(hull, message)
            return message

        counted = Counted(self._metrics, lambda message: message.WhichOneof("event"))
        await send_each(call, events, encoded, self._max_watch_lag, counted)

    async def Replay(self, request: pb.ReplayRequest, call: Call) -> None:
        hull = self._read(call, request.name)
        call.access.require_past(hull.name)
        await self._replays.send(request, hull, call)

    async def Track(self, request: pb.TrackRequest, call: Call) -> None:
        hull = self._read(call, request.name)
        call.access.require_past(hull.name)
        await self._tracks.send(request, hull, call)

    async def WatchMany(self, request: pb.WatchManyRequest, call: Call) -> None:
        choice = decode.decode_many(request)
        require_many(choice, call.access, self._quotas)
        encoding = decode.decode_encoding(request.encoding)
        outline, most = decode.decode_many_contents(request)
        position = decode.decode_many_position(request)
        interval = decode.decode_rate(request.max_events_per_second) or MANY_INTERVAL
        states = HullStates(self._hulls, encoding, outline=outline, most=most)
        kind = encoding, outline, most
        with (
            self._quotas.watches.take(call.owner),
            self._hulls.rosters.use(kind, choice, lambda: Roster(states, self._quotas.roster)) as roster,
        ):

            async def encoded(part: ManyPart) -> bytes:
                message = encode_many(part)
                if len(message) > call.max_message_bytes:  # the outline of one hull
                    raise LimitExceededError("max_message_bytes", call.max_message_bytes)
                return message

            parts = watch_many(roster, position, interval)
            await send_each(call, parts, encoded, self._max_watch_lag, Counted(self._metrics, "many"))

    async def Feed(self, request: feed_pb2.FeedRequest, call: Call) -> None:
        choice = decode_feed_choice(request)
        if choice is not None:
            await self._feeds.send_many(request, choice, call)
            return
        hull = self._read(call, request.name)
        call.access.require_past(hull.name)
        await self._feeds.send(request, hull, call)

    async def AckFeed(self, request: feed_pb2.AckFeedRequest, call: Call) -> feed_pb2.AckFeedResponse:
        return await self._feeds.acknowledge(request, call)

    async def ListFeedConsumers(
        self, request: feed_pb2.ListFeedConsumersRequest, call: Call
    ) -> feed_pb2.ListFeedConsumersResponse:
        return await self._feeds.listed(request, call)

    async def DeleteFeedConsumer(
        self, request: feed_pb2.DeleteFeedConsumerRequest, call: Call
    ) -> feed_pb2.DeleteFeedConsumerResponse:
        await self._feeds.delete(request, call)
        return feed_pb2.DeleteFeedConsumerResponse()

    def _run(self, rows: int) -> Run:
        """The way to run the steps of an answer that reads this many rows."""
        return at_once if rows <= FEW_ROWS else self._aside

    async def _ask_of_keys(
        self, request: pb.LocateRequest | pb.DistanceRequest, call: Call, hull: LiveHull, question: Question
    ) -> KeyAnswers:
        """The answers about the positions of the keys of a request."""
        owner = hull
        if request.keys_of and request.keys_of != hull.name:
            if decode_moment(request) is not None:
                problem = "is another hull, and a read as of the past is about one"
                raise decode.InvalidFieldError("keys_of", request.keys_of, problem)
            owner = self._read(call, request.keys_of, "keys_of")
        keys = owner.keys(decode_keys(request.keys, "keys"))
        layer = decode.decode_layer(request)
        return await entities.ask_of_keys(
            hull, request.min_revision, owner, request.keys_min_revision, keys, question, layer
        )

    # Names

    def _read(self, call: Call, name: str, field: str = "name") -> LiveHull:
        name = decode.decode_name(name, field)
        call.access.require_read(name)
        return self._hulls.get(name)

    async def _read_at(self, call: Call, request: Any) -> LiveHull:
        """The hull of a read: as it was, if the read is about the past."""
        hull = self._read(call, request.name)
        moment = decode_moment(request)
        if moment is None:
            return hull
        call.access.require_past(hull.name)
        if request.at_uid and request.at_uid != hull.uid:
            raise HullReplacedError(hull.name, hull.uid, "at_uid")
        return await self._hulls.past(hull, *moment, partial(self._pasts.take, call.owner))

    def _written(self, call: Call, name: str) -> str:
        name = decode.decode_name(name)
        call.access.require_write(name)
        return name

    async def _batches(self, call: Call) -> StreamedBatches:
        """The batches of a call, whose first message names the hull."""
        with call.cutoff():
            first = await call.read()
        if first is None:
            raise decode.InvalidFieldError(
                "name", "", "the first message must name the hull, but the call has no message"
            )
        if type(first) in (PointsMessage, PutsMessage):
            first = first.whole()
        name = self._written(call, first.name)
        if first.uid and self._hulls.has(name):
            await require_present(self._hulls.get(name), first.producer, first.uid)
        streamed = StreamedBatches(
            call, first, name, self._hulls, self._driver, self._metrics, create=self._create_on_write
        )
        await streamed.take(first)
        return streamed


@contextmanager
def _naming_fences(call: Call) -> Iterator[None]:
    """A refusal names no fence that the caller may not read."""
    try:
        yield
    except HullFencedError as error:
        if error.fence is None or call.access.may_read(error.fence):
            raise
        raise HullFencedError(error.name, what=error.what) from None


def _parts(contents: Contents) -> Iterator[slice]:
    """The rows of each part of all points; there is at least one part."""
    for first in range(0, max(len(contents), 1), POINTS_A_PART):
        yield slice(first, first + POINTS_A_PART)


def _places(hull: LiveHull, points: points_pb2.Points) -> Checked:
    """The points of a request about a hull: in a geographic one, places on the globe."""
    xy = decode.decode_points(points, "points")
    if hull.geographic:
        decode.require_places(xy, "points")
    return Checked(xy)


def _keys_revision(found: KeyAnswers) -> int:
    """The revision of the hull that has the keys, 0 if it is the hull that answered."""
    return 0 if found.keys_counts is None else found.keys_counts.revision
