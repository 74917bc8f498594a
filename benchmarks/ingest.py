"""What `dynhull ingest` takes from real brokers.

    python benchmarks/ingest.py [--messages 100000] [--repeat 3] [--folder .]

Broker, ingest and a durable server share the machine. Keys are those of 10,000 vehicles, as integers.

* `JetStream, 1 point`: a message for each point, stored beforehand; from the first one read to the last
  one acknowledged.
* `JetStream, 100 points`: 100 points in a message.
* `reading alone`: a program that only reads the same messages, with nats-py's pull consumer.
* `MQTT 3.1.1`, `MQTT 5`: Mosquitto, QoS 1, a message for each point, published meanwhile by `mosquitto_pub` as fast as
  the broker takes them, until the server has the last one; `max_inflight_messages 1000`.
* `reading alone` of MQTT: `mosquitto_sub` reads the same messages at QoS 1, published in the same way.

Points a second: the median, the least and the greatest of the runs. Debian: `apt-get install nats-server mosquitto
mosquitto-clients`.
"""

import argparse
import asyncio
import json
import shutil
import socket
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import nats
from nats.js.api import AckPolicy, ConsumerConfig

from dynhull_client import HullClient, HullNotFoundError

VEHICLES = 10_000
UNACKNOWLEDGED = ConsumerConfig(ack_policy=AckPolicy.NONE)
DYNHULL = str(Path(sys.executable).with_name("dynhull"))


def fix(number: int) -> dict[str, float]:
    return {"id": number % VEHICLES, "x": number % 1009 / 7, "y": number % 1013 / 11}


@contextmanager
def program(*command: object) -> Iterator[int]:
    """A server program on a free port, which `{port}` stands for in the command."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    words = [str(each).replace("{port}", str(port)) for each in command]
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            while True:
                with socket.socket() as probe:
                    if probe.connect_ex(("127.0.0.1", port)) == 0:
                        break
                time.sleep(0.01)
            yield port
        finally:
            process.terminate()


async def store(port: int, messages: int, points: int) -> None:
    """Fill a stream with messages."""
    async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
        stream = connection.jetstream()
        await stream.add_stream(name="S", subjects=["s"])
        for begin in range(0, messages, 1000):
            for number in range(begin, min(begin + 1000, messages)):
                fixes = [fix(number * points + each) for each in range(points)]
                await connection.publish("s", json.dumps(fixes[0] if points == 1 else fixes).encode())
            await connection.flush()
        while (await stream.stream_info("S")).state.messages < messages:
            await asyncio.sleep(0.05)


async def read_alone(port: int, messages: int) -> float:
    async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
        pull = await connection.jetstream().pull_subscribe("s", stream="S", config=UNACKNOWLEDGED)
        begun, found = time.perf_counter(), 0
        while found < messages:
            found += len(await pull.fetch(1000, timeout=5))
        return messages / (time.perf_counter() - begun)


def ingest(address: str, *arguments: str) -> float:
    """Points a second, from the first message read to the last one acknowledged."""
    command = [DYNHULL, "ingest", "--address", address, "--log-format", "json", "--to-end", *arguments]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    lines = [json.loads(line) for line in done.stderr.splitlines()]
    stopped = next(each for each in lines if each["event"] == "stopped")
    return float(stopped["points"] / stopped["seconds"])


def jetstream(address: str, folder: Path, messages: int, points: int) -> tuple[float, float]:
    count = messages // points
    stored = folder / f"nats-{time.time_ns()}"
    with program("nats-server", "-js", "-a", "127.0.0.1", "-p", "{port}", "-sd", stored) as port:
        asyncio.run(store(port, count, points))
        alone = asyncio.run(read_alone(port, count)) * points
        each = ("--each", "$") if points > 1 else ()
        hull = f"h{time.time_ns()}"
        url = f"nats://127.0.0.1:{port}/S"
        taken = ingest(address, url, "--hull", hull, "--key", "$.id", "--x", "$.x", "--y", "$.y", *each)
    return taken, alone


@contextmanager
def mosquitto(folder: Path) -> Iterator[int]:
    """A broker that holds back nothing; yields its port."""
    config = folder / "mosquitto.conf"
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    settings = ["user root", f"listener {port} 127.0.0.1", "allow_anonymous true"]
    config.write_text("\n".join([*settings, "max_inflight_messages 1000", "max_queued_messages 0", ""]))
    with subprocess.Popen(["mosquitto", "-c", str(config)], stderr=subprocess.DEVNULL) as broker:
        try:
            while subprocess.run(publisher(port), input=b"", stderr=subprocess.DEVNULL, check=False).returncode:
                time.sleep(0.05)
            yield port
        finally:
            broker.terminate()


def publisher(port: int) -> list[str]:
    """A command that publishes each line of its input."""
    return [
        "mosquitto_pub",
        "-p",
        str(port),
        "-V",
        "5",
        "-q",
        "1",
        "-D",
        "connect",
        "receive-maximum",
        "1000",
        "-t",
        "s",
        "-l",
    ]


def mqtt(address: str, folder: Path, messages: int, version: str) -> tuple[float, float]:
    """Points a second that are taken, and messages a second that a program takes which only reads."""
    hull = f"h{time.time_ns()}"
    mark = {"id": VEHICLES, "x": 0, "y": 0}
    lines = "".join(json.dumps(each) + "\n" for each in (*map(fix, range(messages)), mark)).encode()
    with mosquitto(folder) as port:
        command = [
            DYNHULL,
            "ingest",
            f"mqtt://127.0.0.1:{port}/s?version={version}",
            "--address",
            address,
            "--hull",
            hull,
        ]
        keys = ["--key", "$.id", "--x", "$.x", "--y", "$.y"]
        with (
            subprocess.Popen([*command, *keys], stderr=subprocess.PIPE, text=True) as taking,
            HullClient(address) as client,
        ):
            assert taking.stderr is not None
            taking.stderr.readline()
            begun = time.perf_counter()
            subprocess.run(publisher(port), input=lines, check=True)
            while not present(client, hull):
                time.sleep(0.02)
            taken = messages / (time.perf_counter() - begun)
            taking.terminate()
    with mosquitto(folder) as port:
        alone = ["mosquitto_sub", "-p", str(port), "-V", "5", "-q", "1", "-t", "s", "-c", "-i", "reader", "-x", "60"]
        subprocess.run([*alone, "-E"], check=True)  # so that the broker keeps what comes before it reads
        begun = time.perf_counter()
        with subprocess.Popen([*alone, "-C", str(messages + 1)], stdout=subprocess.DEVNULL) as reading:
            subprocess.run(publisher(port), input=lines, check=True)
            reading.wait()
        return taken, messages / (time.perf_counter() - begun)


def present(client: HullClient, hull: str) -> bool:
    try:
        return bool(client.positions(hull, [VEHICLES]).present[0])
    except HullNotFoundError:
        return False


def line(name: str, rates: list[float]) -> None:
    print(f"{name:24} {statistics.median(rates):>12,.0f} {min(rates):>12,.0f} {max(rates):>12,.0f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--messages", type=int, default=100_000)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--folder", type=Path, default=Path.cwd(), help="on the disk to measure")
    options = parser.parse_args()
    works: dict[str, Callable[[str, Path], tuple[float, float]]] = {
        "JetStream, 1 point": lambda address, folder: jetstream(address, folder, options.messages, 1),
        "JetStream, 100 points": lambda address, folder: jetstream(address, folder, 5 * options.messages, 100),
        "MQTT 3.1.1": lambda address, folder: mqtt(address, folder, options.messages, "3.1.1"),
        "MQTT 5": lambda address, folder: mqtt(address, folder, options.messages, "5"),
    }
    print(f"{'points a second':24} {'median':>12} {'least':>12} {'greatest':>12}")
    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        folder = Path(name)
        with program(DYNHULL, "serve", "--data", folder / "data", "--port", "{port}") as port:
            for work, run in works.items():
                results = [run(f"127.0.0.1:{port}", folder) for _ in range(options.repeat)]
                line(work, [each[0] for each in results])
                line("  reading alone", [each[1] for each in results])
        shutil.rmtree(folder / "data")


if __name__ == "__main__":
    main()
