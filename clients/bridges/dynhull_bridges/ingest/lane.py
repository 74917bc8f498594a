"""One hull of an ingest: sends chunks as numbered batches, and sends again what is not acknowledged."""

import asyncio
from collections import deque
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NoReturn

import structlog

from dynhull_cli.reading.times import as_times
from dynhull_client import (
    Applied,
    AsyncHullClient,
    DeadlineError,
    DynhullError,
    HullExistsError,
    HullNotFoundError,
    InvalidRequestError,
    LimitExceededError,
    ProducerInUseError,
    SequenceGapError,
    UnavailableError,
)

from ..waiting import Absence
from .chunk import Chunk
from .feed import Message
from .identity import ANSWER, LogIdentity

if TYPE_CHECKING:
    from dynhull_client import AsyncWriter

log = structlog.get_logger("dynhull_ingest")
IN_FLIGHT = 32  # batches that are not acknowledged
WAITING = 4  # chunks beyond these, before the feed is read on
PATIENCE = 10.0  # seconds without a server, after which the log says so
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 30.0


class NotCreatedError(Exception):
    """There is no such hull, and the ingest shall not create one, or it is of another kind."""


class _NoNameError(Exception):
    """No hull can have the name that messages give."""


class _RefusedError(Exception):
    """A chunk was refused."""

    def __init__(self, chunk: Chunk, error: Exception) -> None:
        super().__init__(str(error))
        self.chunk = chunk
        self.error = error


class ChunkLane:
    """Sends chunks to a hull, in order.

    Args:
        client: the client.
        hull: the name of the hull.
        producer: the name under which the hull counts the numbers of the messages; None without numbers.
        identity: of the log that has the messages.
        keyed: whether rows have keys.
        degrees: whether rows seem to be longitudes and latitudes.
        create: settings of the hull if there is none; None to create none.
        conditions: which keys are put, and when they leave: arguments of a put.
        bad: called with each message that is refused, and why.
        settled: called when a chunk is settled, with the number of its rows that were sent, and their effect.
        away: notes that the server does not answer; all lanes share it.
        named_by_messages: whether the name comes from messages, which are bad then if no hull can have it.
    """

    def __init__(
        self,
        client: AsyncHullClient,
        hull: str,
        producer: str | None,
        identity: LogIdentity,
        *,
        keyed: bool,
        degrees: bool,
        create: dict[str, Any] | None,
        conditions: Mapping[str, Any],
        bad: Callable[[Message, Exception], None],
        settled: Callable[[int, Applied | None], None],
        away: Absence,
        named_by_messages: bool,
    ) -> None:
        self._client = client
        self._hull = hull
        self._producer = producer
        self._identity = identity
        self._keyed = keyed
        self._degrees = degrees
        self._create = create
        self._conditions = conditions
        self._bad = bad
        self._settled = settled
        self._away = away
        self._named_by_messages = named_by_messages
        self._kind: str | None = None
        self._uid = ""  # of the hull, once it is known
        self._acknowledged = 0  # the last number that this hull has acknowledged
        self._waiting: deque[Chunk] = deque()  # not given to the writer
        self._flying: deque[Chunk] = deque()  # given to it, and not settled
        self._failure: Exception | None = None
        self._news = asyncio.Event()
        self._room = asyncio.Event()
        self.known = 0  # rows that the hull had already

    async def put(self, chunk: Chunk) -> None:
        """Queue a chunk; waits while many wait already."""
        while len(self._waiting) >= WAITING:
            self._room.clear()
            await self._room.wait()
        self._waiting.append(chunk)
        self._news.set()

    async def run(self) -> None:
        """Send chunks until cancelled.

        Raises:
            DynhullError: the server refuses the writer itself, for example its token, or has been away for too long.
            RestoredError: a backup of the hull was restored, which lacks messages that were taken.
            NotCreatedError: there is no hull that can take the points.
            ValueError: the hull has messages of another log.
            OSError, TooManyBadError: bad messages cannot be kept aside.
        """
        pause = FIRST_PAUSE
        while True:
            before = self._progress()
            try:
                await self._write()
            except _RefusedError as refused:
                self._set_aside(refused.chunk, refused.error)
                continue
            except _NoNameError as error:
                await self._refuse_all(error)
            except (SequenceGapError, ProducerInUseError) as error:
                self._away.ends()
                log.warning("another ingest of the same log writes to the hull", hull=self._hull, error=str(error))
            except HullNotFoundError:
                self._away.ends()
                log.warning("the hull was deleted", hull=self._hull)
            except LimitExceededError as error:
                self._away.ends()
                log.warning("a limit of the server is reached, trying again", hull=self._hull, error=str(error))
            except (UnavailableError, DeadlineError) as error:
                self._away.lasts(error)
            pause = FIRST_PAUSE if self._progress() != before else min(2 * pause, LONGEST_PAUSE)
            await asyncio.sleep(self._away.pause(pause))

    def _progress(self) -> int:
        return len(self._flying) + len(self._waiting)

    async def _write(self) -> None:
        """Send chunks with one writer, until it fails."""
        await self._require_hull()
        await self._identity.require_in(self._hull)
        self._waiting.extendleft(reversed(self._flying))
        self._flying.clear()
        self._failure = None
        writer = self._client.writer(
            self._hull,
            producer=self._producer,
            may_skip=self._producer is not None,
            batch_points=1,
            linger=0,
            in_flight=IN_FLIGHT,
            stop_on_error=True,
            patience=self._away.pause(PATIENCE),
            uid=self._uid,
            acknowledged=self._acknowledged,
        )
        async with writer:
            self._uid, self._acknowledged = writer.uid, writer.sequence
            known = writer.sequence if self._producer is not None else -1
            while True:
                while self._waiting and self._failure is None:
                    await self._send(writer, known)
                if self._failure is not None:
                    self._raise(self._failure)
                self._news.clear()
                await self._news.wait()

    async def _send(self, writer: "AsyncWriter", known: int) -> None:
        """Give the writer the first chunk that waits."""
        chunk = self._waiting.popleft()
        self._room.set()
        rest = chunk.after(known)
        self.known += len(chunk.points) - (0 if rest is None else len(rest.points))
        if rest is None:
            self._away.ends()
            self._settled(0, None)
            return
        self._flying.append(rest)
        sequence = rest.number if self._producer is not None else None
        times = as_times(rest.times) if rest.times[0] is not None else None
        try:
            if rest.deletes:
                outcome = await writer.remove(self._keys(rest), sequence=sequence)
            elif self._keyed:
                outcome = await writer.put(
                    keys=self._keys(rest),
                    points=rest.points,
                    times=times,
                    expire_times=rest.ends,
                    accuracies=rest.accuracies,
                    sequence=sequence,
                    **self._conditions,
                )
            else:
                outcome = await writer.put(rest.points, times=times, sequence=sequence)
        except DynhullError as error:
            if len(self._flying) == 1:
                self._raise(error)
            # The batches before this one hear of the same error, after the last of them that was applied.
            while self._failure is None:
                self._news.clear()
                await self._news.wait()
        except (ValueError, TypeError) as error:
            raise _RefusedError(rest, error) from None
        else:
            outcome.add_done_callback(partial(self._done, rest))

    def _done(self, chunk: Chunk, outcome: asyncio.Future[Any]) -> None:
        """The writer settles batches in order."""
        if outcome.cancelled() or not self._flying:
            return
        error = outcome.exception()
        if error is None and self._flying[0] is chunk:
            self._away.ends()
            self._flying.popleft()
            if self._producer is not None:
                self._acknowledged = chunk.number
            chunk.settle()
            self._settled(len(chunk.points), outcome.result())
        elif self._failure is None and isinstance(error, Exception):
            self._failure = error
        self._news.set()

    def _raise(self, error: Exception) -> None:
        """Raise the error of the writer: as one of the first chunk that is not settled if a row of it is at fault.

        Without a row it is about all messages, as where the hull needs event times: none may be passed over.
        """
        if isinstance(error, InvalidRequestError) and error.row is not None and self._flying:
            raise _RefusedError(self._flying[0], error)
        raise error

    def _keys(self, chunk: Chunk) -> list[Any]:
        if self._kind == "str":
            return [str(each) for each in chunk.keys]
        if all(isinstance(each, int) for each in chunk.keys):
            return chunk.keys
        return [self._integer(each) for each in chunk.keys]

    @staticmethod
    def _integer(key: Any) -> int:
        if isinstance(key, str) and not key.isdecimal():
            raise ValueError(f"the key is {key!r}, and those of the hull are integers")
        return int(key)

    def _set_aside(self, chunk: Chunk, error: Exception) -> None:
        """Keep aside the message at fault, or divide the chunk to find it."""
        self._waiting.extendleft(reversed(self._flying))
        self._flying.clear()
        place = self._waiting.index(chunk)
        if len(chunk.messages) == 1:
            self._bad(chunk.messages[0][0], error)
            del self._waiting[place]
            chunk.settle()
            self._settled(0, None)
            return
        row = error.row if isinstance(error, DynhullError) else None
        parts = chunk.split(row)
        del self._waiting[place]
        for part in reversed(parts):
            self._waiting.insert(place, part)

    async def _refuse_all(self, error: Exception) -> NoReturn:
        """Keep all messages aside, those to come as well."""
        while True:
            for chunk in self._waiting:
                for message, _ in chunk.messages:
                    self._bad(message, error)
                chunk.settle()
                self._settled(0, None)
            self._waiting.clear()
            self._room.set()
            self._news.clear()
            await self._news.wait()

    async def _require_hull(self) -> None:
        """Create the hull if there is none, and learn the type of its keys."""
        try:
            info = (await self._client.get_hull(self._hull, timeout=ANSWER)).info
        except InvalidRequestError as error:
            if self._named_by_messages:
                raise _NoNameError(str(error)) from None
            raise
        except HullNotFoundError as error:
            if self._create is None:
                raise NotCreatedError(f"{error}; `dynhull create` adds one, or leave out --no-create") from None
            settings = dict(self._create)
            if self._keyed:
                settings["keyed"] = "int" if self._first_key_is_integer() else "str"
            try:
                info = await self._client.create_hull(self._hull, **settings)
            except HullExistsError:
                info = (await self._client.get_hull(self._hull)).info
        if (info.keyed is not None) != self._keyed:
            kind = "keys: give --key" if info.keyed is not None else "no keys: leave out --key"
            raise NotCreatedError(f"the points of {self._hull!r} have {kind}, or write to another hull")
        self._kind = info.keyed
        if self._degrees and not info.geographic and not self._named_by_messages:
            log.warning(
                "the hull is a plane: longitudes and latitudes are its x and y, areas square degrees", hull=info.name
            )
            self._degrees = False  # said

    def _first_key_is_integer(self) -> bool:
        first = next((chunk.keys[0] for chunk in (*self._flying, *self._waiting) if chunk.keys), None)
        return isinstance(first, int)
