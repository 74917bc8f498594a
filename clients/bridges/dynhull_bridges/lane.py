"""One source of a relay: its events go to the target one after the other, whatever happens to other sources."""

import asyncio
from contextlib import suppress
from dataclasses import dataclass

import structlog

from dynhull_client import (
    AsyncHullClient,
    DeadlineError,
    DynhullError,
    InvalidRequestError,
    LimitExceededError,
    OutcomeUnknownError,
    UnavailableError,
)

from .dead_letters import StateFolder
from .figures import Figures, labels
from .letters import Letter, letter
from .sources import Event, Source
from .target import GoneError, NotDeliveredError, ReaderGoneError, RefusedError, Target
from .waiting import growing_pauses, unless

LONGEST_RETRY_AFTER = 86400.0  # seconds
FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER = 0.1, 5.0
SECONDS_BETWEEN_LOOKS = 5.0
SECONDS_BETWEEN_ACKNOWLEDGEMENTS = 0.2

# What the server answers at some moment, as while its disk is full: it answers otherwise later.
PASSING = (UnavailableError, DeadlineError, LimitExceededError, OutcomeUnknownError)


@dataclass(frozen=True, slots=True)
class Patience:
    """How often and how fast deliveries are repeated.

    Attributes:
        attempts: how often letters that the receiver refuses are tried before they are dead letters.
        first_pause: the seconds before the first repetition,
        longest_pause: doubled each time up to this.
    """

    attempts: int
    first_pause: float
    longest_pause: float


class Lane:
    """Delivers the events of one fence or alarm in order, and acknowledges them once the target has them.

    Args:
        client: the client of the server.
        source: the fence or the alarm.
        consumer: the name of the durable consumer.
        target: the receiver.
        to: the name of the receiver.
        patience: when to repeat a delivery.
        folder: where dead letters are kept.
        figures: the metrics.
        stop: set when the relay shall end.
    """

    def __init__(
        self,
        client: AsyncHullClient,
        source: Source,
        consumer: str,
        target: Target,
        to: str,
        patience: Patience,
        folder: StateFolder,
        figures: Figures,
        stop: asyncio.Event,
    ) -> None:
        self.disabled = False
        self._client = client
        self._source = source
        self._consumer = consumer
        self._target = target
        self._to = to
        self._patience = patience
        self._folder = folder
        self._figures = figures
        self._labels = labels(source)
        self._stop = stop
        self._log = structlog.get_logger("dynhull_relay").bind(**{source.kind: source.name})
        # Bounded: while the receiver is slow, the server keeps the events.
        self._arrived: asyncio.Queue[Event | None] = asyncio.Queue(2 * target.most)
        self._last: Event | None = None  # of those that have arrived
        self._done: Event | None = None
        self._acknowledged: Event | None = None
        self._news = asyncio.Event()
        self._begun = False
        figures.add(source)

    async def run(self) -> None:
        """Deliver until the source is deleted, its receiver is gone, or the relay stops.

        Raises:
            DynhullError: the server refuses to send the events, of a source that does not exist for example.
            ReaderGoneError: nobody reads standard output any more.
        """
        async with asyncio.TaskGroup() as group:
            helpers = [group.create_task(each) for each in (self._read(), self._acknowledge(), self._look())]
            try:
                while events := await self._next():
                    await self._deliver(events)
                    if self.disabled:
                        break
            finally:
                for each in helpers:
                    each.cancel()
        with suppress(DynhullError):  # the events are delivered again, then
            await self._acknowledge_now()

    async def _read(self) -> None:
        """Put the events into the queue, from the server that is there."""
        pauses = growing_pauses(FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER)
        while True:
            try:
                async with self._source.watch(self._client, self._consumer) as watch:
                    async for event in watch:
                        self._begun = True
                        pauses = growing_pauses(FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER)
                        if not self._is_known(event):
                            await self._arrived.put(event)
                            self._last = event
                await self._arrived.put(None)
                return
            except DynhullError as error:
                refused = isinstance(error, InvalidRequestError)  # no consumer can have this name, for example
                if refused or (not self._begun and not isinstance(error, PASSING)):
                    raise
                self._log.warning("no events from the server, trying again", error=str(error))
            await asyncio.sleep(next(pauses))

    def _is_known(self, event: Event) -> bool:
        """Whether it arrived before the watch began again; acknowledgements may be behind."""
        known = self._last
        return known is not None and event.uid == known.uid and event.sequence <= known.sequence

    async def _next(self) -> list[Event]:
        """The next events, as many as are there and go into one delivery; none at the end."""
        if self._stop.is_set():
            return []
        first = await unless(self._stop, self._arrived.get())
        found = [] if first is None else [first]
        while found and len(found) < self._target.most and not self._arrived.empty():
            more = self._arrived.get_nowait()
            if more is None:
                self._arrived.put_nowait(None)
                break
            found.append(more)
        return found

    async def _deliver(self, events: list[Event]) -> None:
        """Deliver events, however long it takes."""
        letters = [letter(each) for each in events]
        pauses = growing_pauses(self._patience.first_pause, self._patience.longest_pause)
        refusals = 0
        while not self._stop.is_set():
            try:
                await self._target.deliver(letters)
            except GoneError as error:
                self._log.error("the receiver is gone: no more deliveries", to=self._to, answer=str(error))
                try:
                    self._folder.disable(self._source, self._to, str(error))
                except (OSError, ValueError) as failure:
                    self._log.error("not remembered: the next relay asks the receiver again", error=str(failure))
                self.disabled = True
                return
            except ReaderGoneError:
                raise
            except Exception as error:
                self._figures.failed.labels(*self._labels).inc()
                refusals += isinstance(error, RefusedError)
                if isinstance(error, RefusedError) and refusals >= self._patience.attempts:
                    left = self._bury(letters, error, refusals)
                    if not left:
                        break
                    if len(left) < len(letters):
                        letters, refusals = left, 0
                        continue
                asked = error.retry_after or 0.0 if isinstance(error, NotDeliveredError) else 0.0
                pause = max(next(pauses), min(asked, LONGEST_RETRY_AFTER))
                self._log.warning(
                    "not delivered, trying again",
                    id=letters[0].id,
                    error=str(error),
                    pause=round(pause, 3),
                    exc_info=not isinstance(error, NotDeliveredError),  # nobody has foreseen it
                )
                await unless(self._stop, asyncio.sleep(pause))
            else:
                self._figures.delivered.labels(*self._labels).inc(len(letters))
                break
        else:
            return
        self._figures.lost.labels(*self._labels).inc(sum(e.last - e.first + 1 for e in events if e.type == "lost"))
        self._done = events[-1]
        self._news.set()

    def _bury(self, letters: list[Letter], error: RefusedError, attempts: int) -> list[Letter]:
        """Keep what is refused; returns what is still to deliver: all of it where it could not be kept."""
        refused = letters if error.letter is None else [error.letter]
        reason = str(error)
        try:
            for each in refused:
                self._folder.bury(each, self._target.place(each), reason, attempts)
        except OSError as failure:
            self._log.error("no dead letter can be kept", error=str(failure))
            return letters
        self._figures.dead.labels(*self._labels).inc(len(refused))
        self._log.error("refused: a dead letter now", id=refused[0].id, letters=len(refused), error=reason)
        return [each for each in letters if each not in refused]

    async def _acknowledge(self) -> None:
        """Acknowledge what is delivered, now and then: each acknowledgement is a commit of the server."""
        pauses = growing_pauses(FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER)
        while True:
            await self._news.wait()
            self._news.clear()
            try:
                await self._acknowledge_now()
                pauses = growing_pauses(FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER)
                await asyncio.sleep(SECONDS_BETWEEN_ACKNOWLEDGEMENTS)
            except PASSING as error:
                self._log.warning("not acknowledged, trying again", error=str(error))
                self._news.set()
                await asyncio.sleep(next(pauses))
            except DynhullError as error:  # of a source that was created again, for example: the next one counts
                self._log.warning("not acknowledged", error=str(error))

    async def _acknowledge_now(self) -> None:
        done = self._done
        if done is not None and done is not self._acknowledged and done.type != "closed":
            consumer = await self._source.acknowledge(self._client, self._consumer, done)
            self._acknowledged = done
            self._figures.behind(self._source, consumer)

    async def _look(self) -> None:
        """Ask the server how far the consumer is behind, now and then: it may be all that moves."""
        while True:
            with suppress(DynhullError):  # the reader reports it
                consumers = await self._source.consumers(self._client)
                self._begun = True
                for each in consumers:
                    if each.name == self._consumer:
                        self._figures.behind(self._source, each)
            await asyncio.sleep(SECONDS_BETWEEN_LOOKS)
