"""The calls that concern names of several workers: composed from the answers of each, or refused.

Composed: the lists of hulls and of fences, `Separate`, and the reads of a `Query` call. Refused, with what to do: what
has to be of one commit or one moment, as batches over several hulls, fences, and keys of another hull.
"""

import asyncio
from collections.abc import Awaitable, Callable, Iterable
from functools import partial
from typing import Any

from dynhull_proto.v1 import alarm_service_pb2, fence_service_pb2, hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.rpc import answers, decode
from dynhull_server.rpc.access import Rights
from dynhull_server.rpc.calls import Call, Work
from dynhull_server.rpc.decode_alarm import decode_alarm, decode_alarm_name
from dynhull_server.rpc.decode_fence import decode_fence, decode_fence_name
from dynhull_server.rpc.methods import ALARMS, DESCRIPTOR, FENCES
from dynhull_server.rpc.status import HullsApartError
from dynhull_server.state.errors import HullEmptyError, HullUnsuitableError
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.hull_state import Counts

from .merged_query import MergedQuery
from .relay import Relay, Route
from .worker_link import WorkerLink

HULLS, FENCE_CALLS, ALARM_CALLS = (f"/{each.full_name}" for each in (DESCRIPTOR, FENCES, ALARMS))
BETWEEN = f"{FENCE_CALLS}/FenceEventsBetween"
# The methods that list what a field of their answers has.
LISTS = {
    "hulls": f"{HULLS}/ListHulls",
    "fences": f"{FENCE_CALLS}/ListFences",
    "alarms": f"{ALARM_CALLS}/ListAlarms",
}
PREFIX_PROBLEM = 'with several workers, a prefix has a "/": names have a worker in common if they agree before it'
# The fields of a request that name hulls or fences, and the names.
Names = Callable[[Any], Iterable[tuple[str, str]]]
# Raises PermissionDeniedError if a request may not have this name in this field.
Require = Callable[[Rights, str, str], None]


class Composed:
    """The methods for which a gateway of several workers does more than it does for one, which checks all itself.

    Args:
        relay: the workers.
        max_corners: the largest number of corners of the area of a fence.

    Attributes:
        works: what such a method does, by its path.
        routes: for others, what finds the worker of a request, by the path of the method.
    """

    def __init__(self, relay: Relay, max_corners: int) -> None:
        self._relay = relay
        fence_names = partial(_names_of_fence, max_corners)
        self.works: dict[str, Work] = {
            f"{HULLS}/ListHulls": partial(self._list, pb.ListHullsRequest, pb.ListHullsResponse, "hulls"),
            f"{FENCE_CALLS}/ListFences": partial(
                self._list, fence_service_pb2.ListFencesRequest, fence_service_pb2.ListFencesResponse, "fences"
            ),
            f"{ALARM_CALLS}/ListAlarms": partial(
                self._list, alarm_service_pb2.ListAlarmsRequest, alarm_service_pb2.ListAlarmsResponse, "alarms"
            ),
            f"{HULLS}/Separate": self._separate,
            f"{HULLS}/Query": self._query,
            BETWEEN: partial(self._between, partial(_names_of_past_fence, max_corners)),
        }
        fences = fence_service_pb2
        all_of = partial(self._common_link, pb.ApplyTogetherRequest, _names_of_batches, _require_write)
        create = partial(self._common_link, fences.CreateFenceRequest, fence_names, _require_of_fence)
        replace = partial(self._common_link, fences.ReplaceFenceRequest, fence_names, _require_of_fence)
        self.routes: dict[str, Route] = {
            f"{HULLS}/ApplyTogether": all_of,
            f"{HULLS}/Locate": partial(self._common_link, pb.LocateRequest, names_with_keys, _require_read),
            f"{HULLS}/Distance": partial(self._common_link, pb.DistanceRequest, names_with_keys, _require_read),
            f"{FENCE_CALLS}/CreateFence": create,
            f"{FENCE_CALLS}/ReplaceFence": replace,
            f"{ALARM_CALLS}/CreateAlarm": partial(
                self._common_link, alarm_service_pb2.CreateAlarmRequest, _names_of_alarm, _require_of_fence
            ),
        }

    def _common_link(self, kind: Any, names: Names, require: Require, message: bytes, call: Call) -> WorkerLink:
        if len(self._relay.links) == 1:
            return self._relay.links[0]
        found = list(names(kind.FromString(message)))
        try:
            return common_link(self._relay, found)
        except HullsApartError:  # only for callers that may use the names
            for field, name in found:
                require(call.access, field, name)
            raise

    async def _between(self, names: Names, call: Call) -> None:
        """The events of a fence after the fact, from the worker that has its hulls."""
        with call.stream():
            with call.cutoff():
                message = await call.receive()
                kind = fence_service_pb2.FenceEventsBetweenRequest
                link = self._common_link(kind, names, _require_past, message, call)
            await self._relay.read_from(link, BETWEEN, call, message)

    async def _list(self, request: Any, response: Any, field: str, call: Call) -> bytes:
        """One page of all workers, by name."""
        method = LISTS[field]
        with call.cutoff():
            message = await call.receive()
        call.finish()
        pages = await self._relay.found(lambda: together(link.ask(method, call, message) for link in self._relay.links))
        if len(pages) == 1:
            return pages[0]
        _, _, size = decode.decode_page(request.FromString(message))  # each worker has accepted it
        parsed = [response.FromString(page) for page in pages]
        found = sorted((each for page in parsed for each in getattr(page, field)), key=lambda each: each.name)
        more = len(found) > size or any(page.next_page_token for page in parsed)
        merged = response(next_page_token=found[:size][-1].name if more else "")
        getattr(merged, field).extend(found[:size])
        return call.serialize(merged)

    async def _separate(self, call: Call) -> bytes:
        with call.cutoff():
            message = await call.receive()
            return await self._relay.found(lambda: self.separate(call, message))

    async def separate(self, call: Call, message: bytes) -> bytes:
        """The answer to a request for the separation of two hulls.

        No batch is in hulls of two workers, so hulls read one after the other are as they were at one moment.
        """
        request = pb.SeparateRequest.FromString(message)
        link, other_link = self._relay.link(request.name), self._relay.link(request.other_name)
        if link is other_link:
            return await link.ask(f"{HULLS}/Separate", call, message)
        decode.decode_name(request.name)
        decode.decode_name(request.other_name, "other_name")
        encoding = decode.decode_encoding(request.encoding)
        wanted = (
            (link, pb.GetHullRequest(name=request.name, min_revision=request.min_revision)),
            (other_link, pb.GetHullRequest(name=request.other_name, min_revision=request.other_min_revision)),
        )
        read = await together(
            each.ask(f"{HULLS}/GetHull", call, question.SerializeToString()) for each, question in wanted
        )
        hull, other = map(pb.GetHullResponse.FromString, read)
        geographic = [each.hull.config.frame == hull_pb2.FRAME_GEOGRAPHIC for each in (hull, other)]
        if geographic[0] != geographic[1]:
            kinds = [("geographic" if each else "a plane") for each in geographic]
            problem = f"is {kinds[1]}, and {request.name!r} is {kinds[0]}"
            raise HullUnsuitableError(request.other_name, problem, field="other_name")
        for each in (hull, other):
            if not each.hull.point_count:
                raise HullEmptyError(each.hull.name)
        separation = answers.separation_on_globe if geographic[0] else answers.separation
        vertices, other_vertices = (decode.decode_points(each.vertices, "vertices") for each in (hull, other))
        response = await asyncio.to_thread(
            separation, _counts(hull.hull), vertices, _counts(other.hull), other_vertices, encoding
        )
        return call.serialize(response)

    async def _query(self, call: Call) -> None:
        if len(self._relay.links) == 1:
            await self._relay.write(f"{HULLS}/Query", call)
            return
        with call.stream():
            merged = MergedQuery(call, self._relay, self.separate)
            try:
                async for message in call.messages():
                    with call.cutoff():
                        await merged.answer(pb.QueryRequest.FromString(message).reads)
            finally:
                merged.close()


def common_link(relay: Relay, names: Iterable[tuple[str, str]]) -> WorkerLink:
    """The worker that has all of the names, each given with its field. Raises HullsApartError if there is none."""
    (_, first), *others = names
    link = relay.link(first)
    for field, name in others:
        if relay.link(name) is not link:
            raise HullsApartError(field, name, first)
    return link


def names_with_keys(request: Any) -> Iterable[tuple[str, str]]:
    """The names in a request about points, or about keys of this hull or another one."""
    yield "name", request.name
    if request.keys_of:
        yield "keys_of", decode.decode_name(request.keys_of, "keys_of")


def _require_read(access: Rights, _: str, name: str) -> None:
    access.require_read(name)


def _require_past(access: Rights, _: str, name: str) -> None:
    access.require_past(name)


def _require_write(access: Rights, _: str, name: str) -> None:
    access.require_write(name)


def _require_of_fence(access: Rights, field: str, name: str) -> None:
    (access.require_write if field == "name" else access.require_read)(name)


def _names_of_batches(request: pb.ApplyTogetherRequest) -> Iterable[tuple[str, str]]:
    return [(f"batches[{index}].name", name) for index, name in enumerate(decode.decode_parts(request))]


def _names_of_fence(max_corners: int, request: Any) -> Iterable[tuple[str, str]]:
    """The names of a fence and of its hulls. A prefix has to have a whole first part."""
    config = decode_fence(request, max_corners)
    yield "name", decode_fence_name(request.name)
    _require_whole_part(config)
    yield from _hulls_of(request, config)


def _names_of_past_fence(max_corners: int, request: Any) -> Iterable[tuple[str, str]]:
    """The names of the hulls of a fence after the fact. A prefix has to have a whole first part."""
    config = decode_fence(request, max_corners)
    _require_whole_part(config)
    return _hulls_of(request, config)


def _require_whole_part(config: FenceConfig) -> None:
    if config.kind == "prefix" and "/" not in config.subjects:
        raise decode.InvalidFieldError("config.subject_prefix", config.subjects, PREFIX_PROBLEM)


def _hulls_of(request: Any, config: FenceConfig) -> Iterable[tuple[str, str]]:
    yield f"config.{request.config.WhichOneof('subjects')}", config.subjects
    if config.area_hull is not None:
        yield "config.hull_area.name", config.area_hull


def _names_of_alarm(request: alarm_service_pb2.CreateAlarmRequest) -> Iterable[tuple[str, str]]:
    """The names of an alarm, of its hull, or the prefix of these, with a whole first part, and of the other hull."""
    config = decode_alarm(request)
    yield "name", decode_alarm_name(request.name)
    if config.kind == "prefix" and "/" not in config.subjects:
        raise decode.InvalidFieldError("rule.prefix", config.subjects, PREFIX_PROBLEM)
    yield f"rule.{request.rule.WhichOneof('hulls')}", config.subjects
    if config.area_hull is not None:
        yield "rule.when", config.area_hull


def _counts(hull: hull_pb2.Hull) -> Counts:
    center = (hull.center.longitude, hull.center.latitude) if hull.HasField("center") else None
    return Counts(hull.revision, hull.point_count, hull.distinct_point_count, center=center)


async def together(asked: Iterable[Awaitable[bytes]]) -> list[bytes]:
    """The answers of several workers. The first refusal in their order is raised, after all have answered."""
    found = await asyncio.gather(*asked, return_exceptions=True)
    for each in found:
        if isinstance(each, BaseException):
            raise each
    return [each for each in found if isinstance(each, bytes)]
