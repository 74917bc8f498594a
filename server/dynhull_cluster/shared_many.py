"""Watches of many hulls at a gateway: what its workers send, merged, and followed by many callers.

Each worker sends its hulls once for all who watch the same. A worker that has ended is followed on by its position as
soon as it is there again; its hulls meanwhile stay as they were.
"""

import asyncio
from collections.abc import Sequence
from contextlib import aclosing, nullcontext
from functools import partial

from google.rpc import code_pb2

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.engine.positions import NOWHERE, Position, Standing, decode_standings
from dynhull_server.engine.roster import Roster, RosterEntry, RosterLimits
from dynhull_server.engine.watch_many import watch_many
from dynhull_server.rpc import decode
from dynhull_server.rpc.calls import Call
from dynhull_server.rpc.many import MANY_INTERVAL, ManyQuotas, encode_many, name_only, require_many
from dynhull_server.rpc.methods import DESCRIPTOR
from dynhull_server.rpc.metrics import Metrics
from dynhull_server.rpc.status import RelayedError, WorkerAwayError
from dynhull_server.state.records import CommitStamp

from .callers import metadata_of, metadata_of_feed
from .feeds import Feeds, tokens_have_changed
from .relay import Relay
from .upstream import one_request
from .worker_link import LOOK_SECONDS, Patience, RetiredError, WorkerLink

WATCH_MANY = f"/{DESCRIPTOR.full_name}/WatchMany"
# States of a hull per second that a worker sends to a gateway: twice as many as a caller gets without asking for more.
UPSTREAM_RATE = 20.0
# States that are taken at once.
TOGETHER = 256


class SharedMany:
    """The watches of many hulls of a gateway.

    Args:
        relay: the workers.
        metrics: counts the watchers.
        quotas: how much a caller may watch.
    """

    def __init__(self, relay: Relay, metrics: Metrics, quotas: ManyQuotas) -> None:
        self._relay = relay
        self._metrics = metrics
        self._quotas = quotas
        self._feeds: Feeds[ManyFeed] = Feeds()

    async def watch(self, call: Call) -> None:
        """The method `WatchMany`."""
        with call.stream(), self._quotas.watches.take(call.owner), self._metrics.watcher() as watcher:
            with call.cutoff():
                message = await call.receive()
            request = pb.WatchManyRequest.FromString(message)
            require_many(decode.decode_many(request), call.access, self._quotas)
            if len(self._relay.links) == 1:
                sending = partial(self._metrics.sending, watcher, "many")
                await self._relay.read_from(self._relay.links[0], WATCH_MANY, call, message, sending)
                return
            decode.decode_encoding(request.encoding)
            decode.decode_many_contents(request)
            interval = decode.decode_rate(request.max_events_per_second) or MANY_INTERVAL
            position = decode.decode_many_position(request)
            while True:
                try:
                    await self._follow(call, request, position, interval, watcher)
                except RetiredError:  # the names are divided among others: all is pictured anew
                    position = NOWHERE

    async def _follow(
        self,
        call: Call,
        request: pb.WatchManyRequest,
        position: Position | None,
        interval: float,
        watcher: object,
    ) -> None:
        links = self._relay.links
        kind = pb.WatchManyRequest()
        kind.CopyFrom(request)
        kind.ClearField("position")
        kind.max_events_per_second = UPSTREAM_RATE
        key = tuple(links), kind.SerializeToString(deterministic=True)
        with self._feeds.use(key, partial(ManyFeed, links, kind, self._quotas.roster)) as feed:
            tokens: int | None = None
            with call.cutoff():
                await feed.complete()
            async with aclosing(watch_many(feed.roster, position, interval)) as parts:
                while True:
                    with call.cutoff():
                        part = await anext(parts)
                        if tokens != feed.tokens:
                            tokens = feed.tokens
                            await _require_allowed(call, links[0], request)
                    if feed.failure is not None:
                        raise feed.failure
                    with self._metrics.sending(watcher, "many"):
                        await self._relay.send(call, encode_many(part))


class ManyFeed:
    """The hulls of several workers.

    Args:
        links: the workers.
        request: what is asked of each, without a position.
        limits: how much may be followed at once.

    Attributes:
        roster: the hulls.
        failure: what it has ended with, or None.
        tokens: the number of times that tokens have changed: those who follow have to ask whether they still may.
    """

    def __init__(self, links: Sequence[WorkerLink], request: pb.WatchManyRequest, limits: RosterLimits) -> None:
        self.roster = Roster(self, limits)
        self.failure: Exception | None = None
        self.tokens = 0
        self._request = request
        self._parts = [_Part(number) for number in range(len(links))]
        self._moved = asyncio.Event()
        self._running = [
            asyncio.create_task(self._run(link, part)) for link, part in zip(links, self._parts, strict=True)
        ]

    @property
    def over(self) -> bool:
        """Whether it has ended by itself."""
        return self.failure is not None

    def close(self) -> None:
        """End it."""
        for each in self._running:
            each.cancel()

    async def complete(self) -> None:
        """Wait for the first picture of each worker; raises what has ended the feed."""
        while self.failure is None and not all(part.complete for part in self._parts):
            self._moved.clear()
            await self._moved.wait()
        if self.failure is not None:
            raise self.failure

    # The source of the roster

    def standings(self) -> list[Standing]:
        """How far each worker is."""
        return [part.standing for part in self._parts]

    async def encode(self, entry: RosterEntry) -> bytes:
        """That a hull is gone: the workers have encoded all others."""
        return name_only(entry, pb.HULL_PRESENCE_GONE)

    def unchanged(self, entry: RosterEntry) -> bytes:
        """The name of a hull."""
        return name_only(entry, pb.HULL_PRESENCE_UNCHANGED)

    # The workers

    async def _run(self, link: WorkerLink, part: "_Part") -> None:
        try:
            while True:
                try:
                    await link.arrive(Patience())
                    await self._read(link, part)
                except RetiredError:
                    raise
                except WorkerAwayError:
                    if not part.complete:
                        raise
                except RelayedError as error:
                    if tokens_have_changed(error):
                        self.tokens += 1
                    elif not _passes(error) or not part.complete:
                        raise
                await asyncio.sleep(LOOK_SECONDS)
        except Exception as error:  # each watcher raises it, and logs what is a bug
            self.failure = self.failure or error
            self.roster.begin_anew()
            self._moved.set()

    async def _read(self, link: WorkerLink, part: "_Part") -> None:
        request = pb.WatchManyRequest()
        request.CopyFrom(self._request)
        request.position = part.position
        upstream = link.stream(WATCH_MANY, metadata_of_feed(request.prefix or "many"))
        async with one_request(upstream, request.SerializeToString(), nullcontext()):
            while (message := await upstream.read()) is not None:
                await self._take(part, pb.WatchManyResponse.FromString(message))

    async def _take(self, part: "_Part", response: pb.WatchManyResponse) -> None:
        if response.picture in (pb.PICTURE_BEGINS, pb.PICTURE_BEGINS_ANEW):
            part.named = set()
            part.anew = [] if response.picture == pb.PICTURE_BEGINS_ANEW else None
        for row, hull in enumerate(response.hulls):
            if part.named is not None:
                part.named.add(hull.name)
            if part.anew is not None:  # states that have gone back are seen all at once
                part.anew.append(hull)
            else:
                self._note(part, hull)
                self.roster.require_within_limits()
            if row % TOGETHER == TOGETHER - 1:
                await asyncio.sleep(0)
        if response.position:
            part.position = response.position
            part.standing = decode_standings(response.position)[0]
        if response.picture == pb.PICTURE_COMPLETE:
            self._complete(part)

    def _complete(self, part: "_Part") -> None:
        for hull in part.anew or ():
            self._note(part, hull)
        assert part.named is not None  # a picture has begun
        for entry in self.roster.entries():
            if entry.partition == part.number and entry.name not in part.named:
                self.roster.end(entry.name)
        if part.anew is not None and part.complete:
            self.roster.begin_anew()
        part.named = part.anew = None
        part.complete = True
        self._moved.set()

    def _note(self, part: "_Part", hull: pb.HullNow) -> None:
        if hull.presence == pb.HULL_PRESENCE_GONE:
            self.roster.end(hull.name)
        elif hull.presence != pb.HULL_PRESENCE_UNCHANGED:
            time = hull.changed_time.ToMicroseconds()
            self.roster.change(
                hull.name,
                CommitStamp(hull.commit, time) if hull.HasField("changed_time") else None,
                partition=part.number,
                new=not hull.revision,
                state=pb.WatchManyResponse(hulls=[hull]).SerializeToString(),
            )


class _Part:
    """What is known of one worker.

    Attributes:
        number: its number.
        standing: how far it is.
        position: the same as it has said it.
        complete: whether there has been a picture of it.
        named: the hulls of the picture that has begun, None while none has.
        anew: the states of a picture that replaces all, None otherwise.
    """

    def __init__(self, number: int) -> None:
        self.number = number
        self.standing = Standing(0, 0, 0)
        self.position = b""
        self.complete = False
        self.named: set[str] | None = None
        self.anew: list[pb.HullNow] | None = None


async def _require_allowed(call: Call, link: WorkerLink, request: pb.WatchManyRequest) -> None:
    """Have a worker say whether the caller may watch this: its file of tokens may be another one than the gateway's."""
    if not call.caller.key:
        return
    try:
        await link.arrive(Patience())
        async with one_request(
            link.stream(WATCH_MANY, metadata_of(call)), request.SerializeToString(), nullcontext()
        ) as upstream:
            await upstream.read()
    except (WorkerAwayError, RelayedError) as error:
        if not (isinstance(error, RelayedError) and _passes(error)):
            raise


def _passes(error: RelayedError) -> bool:
    """Whether what a worker has ended with passes: it stops, or was killed."""
    return bool(error.status.code == code_pb2.UNAVAILABLE)
