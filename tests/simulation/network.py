"""A simulated network between a gateway and a worker: bytes arrive in pieces, late, or not at all.

A connection that has gone dark says nothing of it: what is written disappears, in one direction or both. Darkness may
end, then what was written since arrives; or it does not, and only connections made afterwards work.
"""

import asyncio
from collections.abc import Callable
from typing import Any

from .machine import Loop
from .model import Model
from .schedule import Schedule

# The bytes on their way beyond which a writer has to wait, and below which it may go on.
HIGH, LOW = 2_000, 500
# How seldom time passes while anything moves.
HASTE = 0.02
# Seconds between attempts to connect while the network is dark.
AGAIN = 0.1
TO_WORKER, TO_GATEWAY = 0, 1


class Wire(asyncio.Transport):
    """One end of a connection, and the bytes on their way from it to the other end.

    Args:
        network: the network.
        loop: the event loop of whoever has this end.
        direction: where to its bytes go.
    """

    protocol: Any
    other: "Wire"

    def __init__(self, network: "Network", loop: Loop, direction: int) -> None:
        super().__init__()
        self.loop = loop
        self.direction = direction
        self.unsent = bytearray()
        self.lost = False  # whether what is written never arrives
        self.open, self.closing, self.reading, self._waits = True, False, True, False
        self._network = network

    def get_extra_info(self, name: str, default: Any = None) -> Any:  # noqa: ARG002
        return self

    def setsockopt(self, *_: object) -> None:
        """As of the socket, which this is, too."""

    def write(self, data: Any) -> None:
        if self.open and not self.closing:
            self.unsent += data
            if len(self.unsent) > HIGH and not self._waits:
                self._waits = True
                self.call("pause_writing")

    def close(self) -> None:
        self.closing = True

    def abort(self) -> None:
        if self.open:
            self.unsent.clear()
            self._end()

    def pause_reading(self) -> None:
        self.reading = False

    def resume_reading(self) -> None:
        self.reading = True

    @property
    def moves(self) -> bool:
        """Whether anything can be taken off this end."""
        dark = self.lost or self._network.dark[self.direction]
        return self.open and not dark and self.other.reading and (bool(self.unsent) or self.closing)

    def move(self, most: int) -> None:
        """Some bytes arrive; or the end, if there are none left."""
        data = bytes(self.unsent[:most])
        del self.unsent[:most]
        if data and self.other.open:
            self.other.call("data_received", data)
        if self._waits and len(self.unsent) < LOW:
            self._waits = False
            self.call("resume_writing")
        if self.closing and not self.unsent:
            self._end()

    def call(self, name: str, *arguments: Any) -> None:
        """Have the protocol of this end called soon; by then it is there."""
        self.loop.call_soon(lambda: getattr(self.protocol, name)(*arguments))

    def _end(self) -> None:
        self.open = False
        self.call("connection_lost", None)
        if self.other.open and not self.lost and not self._network.dark[self.direction]:
            self.other.unsent.clear()
            self.other.open = False
            self.other.call("connection_lost", None)


class Network:
    """All connections.

    Attributes:
        dark: whether nothing arrives at present, by direction.
        hasty: whether time may pass while anything moves.
    """

    def __init__(self, schedule: Schedule) -> None:
        self.dark = [False, False]
        self.hasty = False
        self._schedule = schedule
        self._wires: list[Wire] = []
        self._listening: dict[int, tuple[Loop, Callable[[Wire], None]]] = {}
        schedule.actor("network", lambda: self.moves, self._move)

    @property
    def moves(self) -> bool:
        """Whether anything is on its way."""
        return any(wire.moves for wire in self._wires)

    def listen(self, loop: Loop, accept: Callable[[Wire], None], port: int = 0) -> None:
        """Have connections to a port accepted: the protocol of the wire is made, and hears that it is connected."""
        self._listening[port] = loop, accept

    def stop_listening(self, loop: Loop) -> None:
        """The process with a loop takes no more connections."""
        self._listening = {port: each for port, each in self._listening.items() if each[0] is not loop}

    def leave(self, loop: Loop) -> None:
        """It has ended: others hear of it, if they can."""
        self.stop_listening(loop)
        for wire in self._wires:
            if wire.loop is loop:
                wire.abort()

    async def connect(self, loop: Loop, make: Callable[[], Any], port: int = 0) -> tuple[Wire, Any]:
        """A connection, once the network is not dark."""
        while any(self.dark):
            await asyncio.sleep(AGAIN)
        if port not in self._listening:
            raise ConnectionRefusedError("nobody listens")
        theirs, accept = self._listening[port]
        own, other = Wire(self, loop, TO_WORKER), Wire(self, theirs, TO_GATEWAY)
        own.other, other.other = other, own
        own.protocol = make()
        self._wires = [wire for wire in self._wires if wire.open] + [own, other]
        accept(other)
        own.protocol.connection_made(own)
        return own, own.protocol

    def lose(self, directions: list[int]) -> None:
        """Connections of now carry nothing any more in these directions, for ever."""
        for wire in self._wires:
            wire.lost |= wire.direction in directions

    def cut(self) -> None:
        """All connections end, and both ends hear of it."""
        for wire in self._wires:
            wire.abort()

    def _move(self) -> None:
        wire = self._schedule.random.choice([wire for wire in self._wires if wire.moves])
        wire.move(1 + int(self._schedule.random.expovariate(1 / 200)))


class NetworkLoop(Loop):
    """An event loop with a network."""

    def __init__(self, model: Model, schedule: Schedule) -> None:
        super().__init__(model, schedule)
        self._schedule = schedule
        self.network = Network(schedule)

    def _may_pass(self) -> object:
        """Hardly ever while anything moves: else nothing would arrive within a second."""
        busy = self._ready or self.network.moves
        return self._timers and (not busy or (self.network.hasty and self._schedule.random.random() < HASTE))

    async def create_connection(self, make: Any, *_: Any, **__: Any) -> Any:  # type: ignore[override]
        return await self.network.connect(self, make)

    async def create_server(self, make: Any, *_: Any, **__: Any) -> Any:  # type: ignore[override]
        self.network.listen(self, lambda wire: greeted(wire, make()))


def greeted(wire: Wire, protocol: Any) -> None:
    """Whoever listens has the other end of a connection."""
    wire.protocol = protocol
    protocol.connection_made(wire)
