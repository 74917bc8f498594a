"""Ports for programs that start again where they were."""

import secrets
import socket
from contextlib import suppress

# Below those that the system gives to connections and to servers that ask for any: others would take it in between.
PORTS = range(10_000, 32_000)


def free_port() -> int:
    """A port that a program can have, and again after it was killed."""
    while True:
        port = secrets.choice(PORTS)
        with suppress(OSError), socket.create_server(("127.0.0.1", port)):
            return port
