"""Nodes of a Ray on this machine, as operators start them, and the servers that Ray has started on them."""

import os
import secrets
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

from cluster import descendants
from patience import PATIENCE, wait_until
from ports import free_port

RAY = str(Path(sys.executable).with_name("ray"))
MEMORY = "100000000"
# Any ports: those of a range are refused if the port of the GCS is among them.
WORKERS = "--min-worker-port=0", "--max-worker-port=0"
# Ray counts its users unless asked not to, and without a token puts one into the home folder. Nodes that have lost
# their GCS end after so many seconds, a minute otherwise.
ENVIRONMENT = {
    "RAY_USAGE_STATS_ENABLED": "0",
    "RAY_AUTH_MODE": "token",
    "RAY_AUTH_TOKEN": secrets.token_hex(16),
    "RAY_gcs_rpc_server_reconnect_timeout_s": "5",
}


class Node:
    """A node, until `stop`; the first one has the GCS, and no processor for servers.

    Args:
        folder: for its logs and sockets.
        address: that of the first node; empty for the first node itself.

    Attributes:
        address: that of the first node.
        folder: the folder.
    """

    def __init__(self, folder: Path, address: str = "") -> None:
        first = ["--head", "--num-cpus=0", "--include-dashboard=false", f"--temp-dir={folder}"]
        self.address = address or f"127.0.0.1:{free_port()}"
        port = self.address.rpartition(":")[2]
        where = ["--num-cpus=1", f"--address={address}"] if address else [*first, f"--port={port}"]
        self.folder = folder
        self._log = (folder / f"node-{free_port()}.log").open("w+")
        self._process = subprocess.Popen(
            [
                RAY,
                "start",
                "--block",
                "--node-ip-address=127.0.0.1",
                f"--object-store-memory={MEMORY}",
                *WORKERS,
                *where,
            ],
            stdout=self._log,
            stderr=self._log,
            env={**os.environ, **ENVIRONMENT},
        )
        wait_until(self._runs)
        self._all = descendants(self._process.pid)

    def _runs(self) -> bool:
        self._log.seek(0)
        said = self._log.read()
        assert self._process.poll() is None, said
        return "Ray runtime started" in said

    def kill(self, name: str) -> None:
        """SIGKILL the process of the node that has this name."""
        os.kill(next(each for each in self._all if _name(each) == name), signal.SIGKILL)

    def servers(self) -> list[int]:
        """The processes of servers that its actors have started."""
        return servers(self._process.pid)

    def stop(self) -> None:
        """End it, and what is left of it."""
        left = {*self._all, *descendants(self._process.pid)}
        self._process.terminate()
        self._process.wait(PATIENCE)
        for each in left:
            if _name(each):
                try:
                    os.kill(each, signal.SIGKILL)
                except ProcessLookupError:
                    continue
        self._log.close()


@contextmanager
def nodes_of_ray(count: int) -> Iterator[list[Node]]:
    """That many nodes for servers, after the one that has the GCS."""
    with TemporaryDirectory(prefix="ray-", ignore_cleanup_errors=True) as folder, ExitStack() as stack:
        nodes: list[Node] = []
        for _ in range(count + 1):
            nodes.append(Node(Path(folder), nodes[0].address if nodes else ""))
            stack.callback(nodes[-1].stop)
        yield nodes


def servers(process: int) -> list[int]:
    """The servers of a cluster among the descendants of a process."""
    return [each for each in descendants(process) if {b"serve", b"--cluster"} <= {*_words(each)}]


def _words(process: int) -> list[bytes]:
    try:
        return Path(f"/proc/{process}/cmdline").read_bytes().split(b"\0")
    except OSError:  # it has just ended
        return []


def _name(process: int) -> str:
    """What the operating system calls a process; empty for one that has ended."""
    try:
        return Path(f"/proc/{process}/comm").read_text().strip()
    except OSError:
        return ""
