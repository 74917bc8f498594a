"""Real ingests of a real JetStream into a real server, all of which are killed again and again.

    python tests/robustness/bridges/ingest_torture.py [--kills 50] [--only broker] [--seed 0]

Points without keys go into a stream, each of them another, while SIGKILL hits an ingest, the broker or the server at
any moment, and each starts again on what is left. Two ingests read the same stream, so that there is always one that
believes it is the only one. At the end the hull has every point of the stream, exactly once.

The broker acknowledges messages a moment before it writes them: it is given that moment before it is killed.
"""

import argparse
import asyncio
import json
import random
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Sequence
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import nats
from nats.js.client import JetStreamContext

sys.path.append(str(Path(__file__).parents[2] / "support"))
from brokers import broker, nats_server
from ingest_process import ingest_process, ingested
from patience import PATIENCE, wait_until
from ports import free_port
from server_process import Server, server_process

from dynhull_client import HullClient

HULL = STREAM = "tortured"
MESSAGES, POINTS = 40, 5  # published at a time, and points in each
FLUSHED = 0.3  # seconds after which the broker has written what it acknowledged
SERVER, BROKER, INGEST = "server", "broker", "ingest"
CHOICES = [SERVER, BROKER, INGEST, INGEST]


class Publisher:
    """Publishes points whenever the broker is there, some messages at a time."""

    def __init__(self, port: int) -> None:
        self._url = f"nats://127.0.0.1:{port}"
        self._number = 0
        self._may = threading.Event()
        self._idle = threading.Event()
        self._ends = False
        self._thread = threading.Thread(target=lambda: asyncio.run(self._run()))
        self._failure: BaseException | None = None
        self._thread.start()

    def go_on(self) -> None:
        self._idle.clear()
        self._may.set()

    def pause(self) -> None:
        """Returns when nothing is under way."""
        self._may.clear()
        wait_until(lambda: self._idle.is_set() or self._failure)
        if self._failure:
            raise self._failure

    def end(self) -> None:
        self._ends = True
        self._may.set()
        self._thread.join()

    async def _run(self) -> None:
        try:
            while True:
                self._idle.set()
                await asyncio.to_thread(self._may.wait)
                if self._ends:
                    return
                async with await nats.connect(self._url, allow_reconnect=False) as connection:
                    context = connection.jetstream()
                    while self._may.is_set() and not self._ends:
                        await asyncio.gather(*(self._publish(context) for _ in range(MESSAGES)))
                        await asyncio.sleep(0.005)
        except BaseException as error:
            self._failure = error
            raise

    async def _publish(self, context: JetStreamContext) -> None:
        points = [[self._number + i, (self._number + i) ** 2] for i in range(POINTS)]
        self._number += POINTS
        await context.publish(STREAM, json.dumps(points).encode(), timeout=PATIENCE)


async def make_stream(port: int) -> None:
    async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
        await connection.jetstream().add_stream(name=STREAM, subjects=[STREAM])


async def stored(port: int) -> int:
    """The number of messages in the stream."""
    async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
        return int((await connection.jetstream().stream_info(STREAM)).state.messages)


class Torture:
    def __init__(self, folder: Path, seed: int) -> None:
        self._random = random.Random(seed)
        self._broker_port = free_port()
        self._port = free_port()
        self._broker = nats_server(folder, self._broker_port)
        self._data = folder / "data"
        self._ingest = (f"nats://127.0.0.1:{self._broker_port}/{STREAM}", "--hull", HULL, "--plane", "--each", "$")
        self._ingest += ("--x", "$[0]", "--y", "$[1]")
        self._address = f"127.0.0.1:{self._port}"

    def run(self, kills: int, choices: Sequence[str] = CHOICES) -> str:
        counts: Counter[str] = Counter()
        publisher = Publisher(self._broker_port)
        with ExitStack() as running:
            running.callback(publisher.end)
            victims = {SERVER: ExitStack(), BROKER: ExitStack(), INGEST: ExitStack(), "other": ExitStack()}
            for each in reversed(victims.values()):
                running.push(each)
            processes = {name: self._start(name, stack) for name, stack in victims.items()}
            publisher.go_on()
            while counts.total() < kills:
                time.sleep(self._random.uniform(0, 0.6))
                name = self._random.choice(choices)
                if name == BROKER:
                    publisher.pause()
                    time.sleep(FLUSHED)
                processes[name].kill()
                victims[name].close()
                time.sleep(self._random.choice([0, 0.3]))
                processes[name] = self._start(name, victims[name])
                if name == BROKER:
                    publisher.go_on()
                counts[name] += 1
                print(f"{counts.total()} kills, the last one of the {name}", file=sys.stderr, flush=True)
            publisher.pause()
            time.sleep(FLUSHED)
            for process in processes.values():
                process.kill()
        return f"{dict(counts)}; {self._compare()}"

    def _start(self, name: str, stack: ExitStack) -> subprocess.Popen[Any]:
        if name == SERVER:
            return stack.enter_context(self._server(killed=True)).process
        if name == BROKER:
            process = stack.enter_context(broker(self._broker, self._broker_port))
            asyncio.run(make_stream(self._broker_port))  # an ingest may not wait for one that it has never read
            return process
        return stack.enter_context(ingest_process(self._address, *self._ingest, killed=True)).process

    def _server(self, *, killed: bool = False) -> AbstractContextManager[Server]:
        return server_process("--data", str(self._data), "--port", str(self._port), killed=killed, torn=True)

    def _compare(self) -> str:
        """Each point is another one: what came twice counts once among the distinct ones."""
        with broker(self._broker, self._broker_port), self._server() as server:
            ingested(server.address, *self._ingest)
            sent = POINTS * asyncio.run(stored(self._broker_port))
            with HullClient(server.address) as client:
                info = client.get_hull(HULL).info
                client.verify(HULL)
        return f"points: {sent}, lost: {sent - info.distinct}, doubled: {info.points - info.distinct}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--only", choices=sorted(set(CHOICES)), help="kill nothing else")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        result = Torture(Path(folder), options.seed).run(options.kills, [options.only] if options.only else CHOICES)
    print(result)
    if not result.endswith("lost: 0, doubled: 0"):
        raise SystemExit(1)


if __name__ == "__main__":
    main()
