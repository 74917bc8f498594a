"""A scene live: a server with its gateway and dashboard, until they are ended."""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from queue import Empty, SimpleQueue
from typing import NamedTuple
from urllib.parse import urlencode

from rich.console import Console

from dynhull_client import Circle, HullClient

from .scene import Frame, Scene
from .server import IN_MEMORY, SERVE, Process, running

MINUTE = 60.0  # seconds from a frame to the next


class Begins(NamedTuple):
    """How a scene is shown.

    Attributes:
        frame: the frame with which it begins the first time, if it has more.
        pace: what is said about its speed; `{speed}` and `{pause}` are put in.
    """

    frame: int
    pace: str


# Until six in the morning hardly any flight is in the air.
FIRST_FLIGHTS = Begins(6 * 60, "{speed:g} times as fast as the day was.")
OWN_POINTS = Begins(0, "One batch each {pause:g} seconds, which --speed makes longer or shorter.")
SIGNALS = "SIGINT", "SIGTERM", "SIGHUP"  # not every system has the last


def live(console: Console, scene: Scene, speed: float, begins: Begins) -> None:
    """Start all, print the addresses, and replay the scene over and over until SIGINT, SIGTERM or SIGHUP.

    Args:
        console: for the addresses.
        scene: minutes of keys that move.
        speed: how many times as fast as they were.
        begins: how it is shown.

    Raises:
        RuntimeError: one of the processes did not start, or has ended.
    """
    with (
        stopped_by_signals() as stop,
        running("server", *SERVE, IN_MEMORY, "--metrics-port", "0", lines=2, apart=True) as server,
    ):
        address, metrics = server.addresses
        where = "--port", "0", "--address", address
        with (
            running("gateway", "dynhull_cli", "gateway", *where, apart=True) as gateway,
            running("dashboard", "dynhull_cli", "dashboard", *where, "--metrics", metrics, apart=True) as dashboard,
            HullClient(address) as hulls,
        ):
            if stop.wait(0):
                return
            create(hulls, scene)
            query = urlencode([("hull", scene.hull_name), *(("fence", name) for name in scene.circles)])
            console.print(scene.title, style="bold", markup=False)
            console.print(f"Look at it:  {dashboard.addresses[0]}/?{query}", markup=False)
            console.print(f"Over HTTP:   {gateway.addresses[0]}/hulls", markup=False)
            console.print(f"Over gRPC:   dynhull list --address {address}", markup=False)
            pace = begins.pace.format(speed=speed, pause=MINUTE / speed)
            console.print(f"{pace} It begins again when it has ended. Ctrl-C ends all.", markup=False)
            for note in scene.notes:
                console.print(note, markup=False)
            play(hulls, scene, begins.frame, MINUTE / speed, stop, (server, gateway, dashboard))


class Stop:
    """Whether a signal has come. A handler may note one at any moment of a wait.

    That of a `threading.Event` would wait for a lock that the very wait has taken, which it interrupts.
    """

    def __init__(self) -> None:
        self._come: SimpleQueue[None] = SimpleQueue()

    def note(self, *_: object) -> None:
        """Note a signal: a handler of signals."""
        self._come.put(None)

    def wait(self, seconds: float) -> bool:
        """Wait for one; whether one has come."""
        try:
            self._come.get(timeout=max(0.0, seconds))
        except Empty:
            return False
        self._come.put(None)
        return True


@contextmanager
def stopped_by_signals() -> Iterator[Stop]:
    """Notes the signals that would end the process."""
    stop = Stop()
    numbers = [getattr(signal, name) for name in SIGNALS if hasattr(signal, name)]
    before = [signal.signal(number, stop.note) for number in numbers]
    try:
        yield stop
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)


def create(client: HullClient, scene: Scene) -> None:
    """Create the hull of a scene and its fences."""
    client.create_hull(scene.hull_name, keyed="str", geographic=scene.center is not None, center=scene.center)
    for name, circle in scene.circles.items():
        client.create_fence(name, Circle(*circle), scene.hull_name)


def play(
    client: HullClient, scene: Scene, first: int, pause: float, stop: Stop, processes: tuple[Process, ...] = ()
) -> None:
    """Put the frames of a scene over and over, `pause` seconds apart, from the `first` on, until it is stopped.

    RuntimeError if one of the processes has ended.
    """
    there: set[str] = set()
    due = time.monotonic()
    for begins, frame in _forever(scene, first):
        gone = there - set(frame.keys) if begins else there & set(frame.removed)
        client.put(scene.hull_name, frame.keys, frame.points, remove=sorted(gone))
        there = (there - gone) | set(frame.keys)
        # After a standstill of the machine the day goes on from where it was, and does not catch up.
        due = max(due + pause, time.monotonic())
        if stop.wait(due - time.monotonic()):
            return
        for process in processes:
            process.check()


def _forever(scene: Scene, first: int) -> Iterator[tuple[bool, Frame]]:
    """The frames over and over, each with whether it is the first; the first time from that number on."""
    begin = first if scene.length > first else 0
    while True:
        for number, frame in enumerate(scene.frames()):
            if number >= begin:
                yield number == begin, frame
        begin = 0
