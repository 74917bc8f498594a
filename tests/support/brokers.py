"""Real message brokers, each in a process of its own."""

import socket
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from patience import PATIENCE, wait_until
from peers import program


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


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
