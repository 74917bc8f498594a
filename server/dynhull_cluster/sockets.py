"""Where the workers listen: Unix sockets in a folder that only the user of the server can open."""

import asyncio
import shutil
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import grpc

from .callers import Metadata
from .ways import OPTIONS, F

# The name of a Unix socket has at most 107 bytes.
LONGEST_FOLDER = 80


class Sockets:
    """The sockets in a folder, as ways to the workers."""

    takeover = 0.0

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def frames(self, worker: int) -> Path:
        """The socket for frames."""
        return self.folder / f"{worker}.frames"

    def grpc(self, worker: int) -> Path:
        """The socket for gRPC."""
        return self.folder / f"{worker}.grpc"

    async def connect(self, worker: int, make: Callable[[], F]) -> F:
        """Connect to the socket for frames. Raises OSError."""
        _, frames = await asyncio.get_running_loop().create_unix_connection(make, str(self.frames(worker)))
        return frames

    def channel(self, worker: int) -> Any:
        """A new channel to the socket for gRPC."""
        return grpc.aio.insecure_channel(f"unix:{self.grpc(worker)}", options=OPTIONS)

    def proof(self, _: int) -> Metadata:
        """Nothing: only gateways can reach the sockets."""
        return ()

    def when_moved(self, _: int, __: Callable[[], None]) -> None:
        """Workers have their sockets for good."""


@contextmanager
def socket_folder(data: Path | None = None) -> Iterator[Path]:
    """A private folder for the block: in the data folder, or a temporary one, without data or for too long a name."""
    folder = _made_folder(data)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _made_folder(data: Path | None) -> Path:
    if data is None or len(str(data.absolute())) > LONGEST_FOLDER:
        return Path(tempfile.mkdtemp(prefix="dynhull-"))
    folder = data.absolute() / "sockets"
    folder.mkdir(exist_ok=True)
    folder.chmod(0o700)
    for left in folder.iterdir():
        left.unlink()
    return folder
