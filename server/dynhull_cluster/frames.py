"""Frames: the calls between a gateway and a worker that have one request and one response, over one connection.

gRPC costs both of its sides some 100 µs a message. A frame costs a tenth, because all frames of one turn of the event
loop are one write. Calls that stream, and large messages, use gRPC between the two processes as well, for its flow
control.

A frame is a header, which has the length of the rest, the number of the call and a kind, and the rest: of a request the
method, the caller and the message, each but the last one with its length; of an answer the message, or a
google.rpc.Status. Where others than gateways could connect, the first frame is a greeting: it proves to come from one.

A worker that stops as planned says goodbye, as HTTP/2 does (GOAWAY), with the number of the last request that it has
taken. It answers these, and what came after them has not begun: it is for the next worker. The other end closes the
connection, once it has all answers; until then the worker refuses what comes through gRPC, so that nothing is lost on
the way.

Servers of two versions understand each other, while one after the other is replaced. Before the greeting, and before
the answer to it, a frame says which versions of the protocol its sender speaks (`versions`); without one in common, the
worker closes the connection. Frames of an unknown kind are passed over, and so is this one by earlier versions. For
these, the number of a greeting is the newest version, which the answer has, too. One that does not know this sends 0,
gets no goodbye, and takes the end of the connection for that of the worker.

Between machines, who asks also pings, and takes a connection for lost on which nothing arrives until the next ping. The
answer to a greeting says that a worker answers pings; one of an earlier version does not, and is not pinged.
"""

import asyncio
from enum import IntEnum
from struct import Struct
from typing import cast

HEADER = Struct("<IIB")
LENGTHS = Struct("<HH")

# A larger request goes through gRPC, so that it does not keep others waiting.
MOST_BYTES = 2**18
ANSWERS_PINGS = b"pings"


class Kind(IntEnum):
    """What a frame is."""

    REQUEST = 0
    CANCEL = 1
    ANSWER = 2
    REFUSAL = 3
    GREETING = 4
    GOODBYE = 5
    PING = 6
    PONG = 7
    VERSIONS = 8


KINDS = {each.value: each for each in Kind}


class Frames(asyncio.Protocol):
    """One end of a connection; a subclass defines `received`."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._transport: asyncio.Transport | None = None
        self._unsent: list[bytes] = []
        self._unread = bytearray()

    @property
    def connected(self) -> bool:
        """Whether frames that are sent now can arrive."""
        return self._transport is not None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Begin to send."""
        self._transport = cast("asyncio.Transport", transport)

    def connection_lost(self, _: Exception | None) -> None:
        """Send nothing any more."""
        self._transport = None

    def close(self) -> None:
        """Send what is left, and close the connection."""
        self._flush()
        if self._transport is not None:
            self._transport.close()

    def abort(self) -> None:
        """Close the connection at once."""
        if self._transport is not None:
            self._transport.abort()

    def send(self, number: int, kind: Kind, *parts: bytes) -> None:
        """Send a frame with the others of this turn of the event loop."""
        if not self._unsent:
            self._loop.call_soon(self._flush)
        self._unsent.append(HEADER.pack(sum(map(len, parts)), number, kind))
        self._unsent.extend(parts)

    def received(self, number: int, kind: Kind, rest: bytes) -> None:
        """A frame has arrived."""
        raise NotImplementedError

    def data_received(self, data: bytes) -> None:
        """Take the whole frames out of what has arrived."""
        self._unread += data
        begin, size = 0, len(self._unread)
        with memoryview(self._unread) as unread:
            while size - begin >= HEADER.size:
                length, number, kind = HEADER.unpack_from(unread, begin)
                rest = begin + HEADER.size
                if rest + length > size:
                    break
                begin = rest + length
                if kind in KINDS:
                    self.received(number, KINDS[kind], bytes(unread[rest:begin]))
        del self._unread[:begin]

    def _flush(self) -> None:
        unsent = b"".join(self._unsent)
        self._unsent.clear()
        if unsent and self._transport is not None:
            self._transport.write(unsent)


def pack_request(method: bytes, caller: bytes, message: bytes) -> tuple[bytes, bytes, bytes, bytes]:
    """The rest of a request."""
    return LENGTHS.pack(len(method), len(caller)), method, caller, message


def unpack_request(rest: bytes) -> tuple[bytes, bytes, bytes]:
    """The method, the caller and the message of a request."""
    method_bytes, caller_bytes = LENGTHS.unpack_from(rest)
    caller = LENGTHS.size + method_bytes
    message = caller + caller_bytes
    return rest[LENGTHS.size : caller], rest[caller:message], rest[message:]
