"""The asking end of a connection: that of a gateway, or of the root of a hull over shards."""

import asyncio

from google.rpc.status_pb2 import Status

from dynhull_server.rpc.status import DrainingError, RelayedError, error_status

from .frames import ANSWERS_PINGS, Frames, Kind, pack_request
from .upstream import lost_status
from .versions import NEWEST, UNSAID, Versions, own_versions

NUMBERS = 2**32


class AskingFrames(Frames):
    """The calls in progress.

    Attributes:
        left: is done when nothing more can be asked: the worker has said goodbye, or the connection is lost.
        gone: set when the connection is lost, or has said goodbye to a worker that others have replaced.
        theirs: which versions of the protocol the worker speaks.
        writable: set while the worker takes what is sent, and when nothing more can be asked.
    """

    def __init__(self) -> None:
        super().__init__()
        self.left: asyncio.Future[None] = self._loop.create_future()
        self.gone = asyncio.Event()
        self.theirs = UNSAID
        self.writable = asyncio.Event()
        self.writable.set()
        self._leaving = False
        self._heard = True
        self._answers_pings = False
        self._last = 0
        self._waiting: dict[int, asyncio.Future[bytes]] = {}

    @property
    def connected(self) -> bool:
        """Whether anything can be asked."""
        return super().connected and not self.left.done()

    async def greet(self, greeting: bytes) -> None:
        """Prove to be a gateway. Raises RelayedError if the other end does not accept that."""
        answer = self._waiting[NEWEST] = self._loop.create_future()
        self.send(0, Kind.VERSIONS, own_versions().text.encode())
        self.send(NEWEST, Kind.GREETING, greeting)
        try:
            self._answers_pings = await answer == ANSWERS_PINGS
        finally:
            del self._waiting[NEWEST]

    def ping(self, seconds: float) -> None:
        """Ask the worker whether it is there, now and at this interval; without an answer, the connection is lost."""
        if not self._heard:
            self.abort()
        elif self._transport is not None and self._answers_pings:
            self._heard = False
            self.send(0, Kind.PING)
            self._loop.call_later(seconds, self.ping, seconds)

    def data_received(self, data: bytes) -> None:
        """Whatever arrives shows that the worker is there."""
        self._heard = True
        super().data_received(data)

    async def ask(self, method: str, caller: bytes, message: bytes) -> bytes:
        """The answer to a request. Raises RelayedError if it is refused or not taken, or the connection is lost."""
        self._last = number = (self._last + 1) % NUMBERS
        answer: asyncio.Future[bytes] = self._loop.create_future()
        self._waiting[number] = answer
        self.send(number, Kind.REQUEST, *pack_request(method.encode(), caller, message))
        try:
            return await answer
        except asyncio.CancelledError:
            self.send(number, Kind.CANCEL)
            raise
        finally:
            self._waiting.pop(number, None)
            self._close_if_answered()

    def leave(self) -> None:
        """Close the connection, once everything is answered."""
        self._leaving = True
        self._close_if_answered()

    def replaced(self) -> None:
        """Another process is the worker now: who was it before may say what it had answered as such, if anything."""
        if self.left.done():
            self.gone.set()
        else:
            self.abort()

    def received(self, number: int, kind: Kind, rest: bytes) -> None:
        """Resume the caller."""
        if kind is Kind.GOODBYE:
            self._stop_asking()
            self._refuse_after(number)
            return
        if kind is Kind.PONG:
            return
        if kind is Kind.VERSIONS:
            self.theirs = Versions.of(rest.decode())
            return
        answer = self._waiting.get(number)
        if answer is None or answer.done():
            return
        if kind is Kind.ANSWER:
            answer.set_result(rest)
        else:
            answer.set_exception(RelayedError(Status.FromString(rest)))

    def pause_writing(self) -> None:
        """The worker has not read for a while."""
        if self.connected:
            self.writable.clear()

    def resume_writing(self) -> None:
        """It has read on."""
        self.writable.set()

    def connection_lost(self, error: Exception | None) -> None:
        """Refuse what waits."""
        super().connection_lost(error)
        self._stop_asking()
        self.gone.set()
        for answer in self._waiting.values():
            if not answer.done():
                answer.set_exception(RelayedError(lost_status()))

    def _refuse_after(self, last: int) -> None:
        """Refuse what has not begun, in the words of a worker that refuses requests because it stops."""
        status = error_status(DrainingError())
        for number, answer in self._waiting.items():
            if 0 < (number - last) % NUMBERS < NUMBERS // 2 and not answer.done():
                answer.set_exception(RelayedError(status))

    def _stop_asking(self) -> None:
        self.writable.set()
        if not self.left.done():
            self.left.set_result(None)

    def _close_if_answered(self) -> None:
        if self._leaving and not self._waiting:
            self.close()
