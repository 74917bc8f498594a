"""Real message brokers, each in a process of its own."""

import socket
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from patience import PATIENCE, wait_until
from peers import program
from ports import free_port

KAFKA_JARS = Path(__file__).parents[2] / "build" / "kafka"


@contextmanager
def broker(command: Sequence[object], port: int) -> Iterator[subprocess.Popen[bytes]]:
    """A broker, once it listens."""
    with subprocess.Popen([*map(str, command)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as process:
        try:
            wait_until(lambda: _listens(port))
            yield process
        finally:
            process.kill()
            process.wait(PATIENCE)


def mosquitto(folder: Path, port: int, *settings: str) -> list[object]:
    """The command of an MQTT broker."""
    config = folder / f"mosquitto-{port}.conf"
    own = "user root"  # where root starts it, so that it may write into the folder
    config.write_text("\n".join([own, f"listener {port} 127.0.0.1", "allow_anonymous true", *settings, ""]))
    return [program("mosquitto"), "-c", config]


def nats_server(folder: Path, port: int) -> list[object]:
    """The command of a NATS server with JetStream."""
    return [program("nats-server"), "-js", "-a", "127.0.0.1", "-p", port, "-sd", folder / "nats"]


def kafka(
    folder: Path, port: int, reached_at: str | None = None, protocol: str = "PLAINTEXT", **more: object
) -> list[object]:
    """The command of a Kafka broker that is its own controller; `make kafka` brings its jars.

    It tells clients to connect to `reached_at`, or to itself. `more` are settings, with "__" for dots.
    """
    folder.mkdir(parents=True, exist_ok=True)
    config = folder / "kafka.properties"
    controller = free_port()
    settings = {
        "process.roles": "broker,controller",
        "node.id": 1,
        "controller.quorum.voters": f"1@127.0.0.1:{controller}",
        "controller.listener.names": "CONTROLLER",
        "listeners": f"{protocol}://127.0.0.1:{port},CONTROLLER://127.0.0.1:{controller}",
        "advertised.listeners": f"{protocol}://{reached_at or f'127.0.0.1:{port}'}",
        "log.dirs": folder / "log",
        "auto.create.topics.enable": "false",
        "offsets.topic.num.partitions": 1,
        "offsets.topic.replication.factor": 1,
        "transaction.state.log.num.partitions": 1,
        "transaction.state.log.replication.factor": 1,
        "transaction.state.log.min.isr": 1,
    } | {name.replace("__", "."): value for name, value in more.items()}
    config.write_text("".join(f"{name}={value}\n" for name, value in settings.items()))
    java = [program("java"), "-XX:TieredStopAtLevel=1", "-Xmx512m", "-cp", KAFKA_JARS / "*"]
    cluster = "AAAAAAAAAAAAAAAAAAAAAQ"  # any id
    formatting = [*java, "kafka.tools.StorageTool", "format", "--ignore-formatted", "-t", cluster, "-c", config]
    subprocess.run([*map(str, formatting)], check=True, capture_output=True)
    return [*java, "kafka.Kafka", config]


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
