"""HTTP on one connection: uvicorn's protocol, and how long a caller may take to ask and to read."""

from __future__ import annotations

from http import HTTPStatus
from typing import TYPE_CHECKING, Any, cast

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from .bodies import HERE
from .problems import problem

if TYPE_CHECKING:
    import asyncio

    from fastapi import FastAPI
    from uvicorn.protocols.http.httptools_impl import RequestResponseCycle

    from .figures import Figures
    from .settings import Settings


class Protocol(HttpToolsProtocol):
    """Ends connections of callers that do not go on, and answers with problem details what is not HTTP, too.

    A request must have arrived up to its body, which has limits of its own, some seconds after the first byte of it or
    after the beginning of the connection. Of what is sent, something must be read within some seconds.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        state = cast("FastAPI", self.config.app).state
        self._settings: Settings = state.settings
        self._figures: Figures = state.figures
        self._awaited: asyncio.TimerHandle | None = None  # the end of a head
        self._begun = False  # whether a part of that head is here
        self._in_body = False
        self._read: asyncio.TimerHandle | None = None  # when the caller must have read more
        self._unread = 0
        self._cycles: list[RequestResponseCycle] = []  # of requests that are not answered

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as uvicorn has it
        """Wait for a request."""
        super().connection_made(transport)
        self._await_head()

    def connection_lost(self, exc: Exception | None) -> None:
        """Wait for nothing any more."""
        self._end_head()
        self._end_reading()
        for cycle in self._cycles:  # uvicorn does so for the last one alone
            cycle.disconnected = True
            cycle.message_event.set()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Take what has arrived."""
        if self._awaited is None and not self._in_body and (self.cycle is None or self.cycle.response_complete):
            self._await_head()
        super().data_received(data)

    def on_message_begin(self) -> None:
        """A request begins."""
        self._begun = True
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        """A request is here, but for its body."""
        self._end_head()
        self._in_body = True
        super().on_headers_complete()
        self._cycles.append(self.cycle)

    def on_message_complete(self) -> None:
        """A body is here."""
        self._in_body = False
        cast("dict[str, Any]", self.scope)[HERE] = True  # the application is called later, and need not wait
        super().on_message_complete()

    def on_response_complete(self) -> None:
        """A request is answered; a part of the next one may be here."""
        self._cycles = [cycle for cycle in self._cycles if not cycle.response_complete]
        super().on_response_complete()
        if self._begun and self._awaited is None:
            self._unset_keepalive_if_required()
            self._await_head()

    def pause_writing(self) -> None:
        """The caller has not read for a while."""
        super().pause_writing()
        self._await_reading()

    def resume_writing(self) -> None:
        """The caller has read."""
        self._end_reading()
        super().resume_writing()

    def timeout_keep_alive_handler(self) -> None:
        """Close, once what was sent is read."""
        super().timeout_keep_alive_handler()
        if self.transport.get_write_buffer_size():
            self._await_reading()

    def send_400_response(self, msg: str) -> None:
        """Answer, and close the connection."""
        self._refuse(HTTPStatus.BAD_REQUEST, f"{msg} The connection is closed.", "MALFORMED_MESSAGE")

    def _refuse(self, status: HTTPStatus, detail: str, reason: str) -> None:
        answer = problem(status, detail, reason=reason)
        headers = [*answer.raw_headers, (b"connection", b"close")]
        first = f"HTTP/1.1 {status.value} {status.phrase}".encode()
        lines = [first, *(b"%b: %b" % header for header in headers), b"", bytes(answer.body)]
        self.transport.write(b"\r\n".join(lines))
        self.transport.close()

    def _await_head(self) -> None:
        self._awaited = self.loop.call_later(self._settings.head_seconds, self._head_is_late)

    def _end_head(self) -> None:
        if self._awaited is not None:
            self._awaited.cancel()
        self._awaited, self._begun = None, False

    def _head_is_late(self) -> None:
        self._figures.late_heads.inc()
        if self._begun:
            detail = f"no complete request within {self._settings.head_seconds:g} s. The connection is closed."
            self._refuse(HTTPStatus.REQUEST_TIMEOUT, detail, "HEAD_TOO_SLOW")
        else:
            self.transport.close()

    def _await_reading(self) -> None:
        self._end_reading()
        self._unread = self.transport.get_write_buffer_size()
        self._read = self.loop.call_later(self._settings.reader_seconds, self._require_reading)

    def _end_reading(self) -> None:
        if self._read is not None:
            self._read.cancel()
            self._read = None

    def _require_reading(self) -> None:
        if self.transport.get_write_buffer_size() < self._unread:
            self._await_reading()
            return
        self._figures.deaf_readers.inc()
        self.transport.abort()  # to close would wait until all is read
