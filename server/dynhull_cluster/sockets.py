"""Where the workers listen: Unix sockets in a folder that only the user of the server can open."""

import tempfile
from pathlib import Path

# The name of a Unix socket has at most 107 bytes.
LONGEST_FOLDER = 80


class Sockets:
    """The names of the sockets in a folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def frames(self, worker: int) -> Path:
        """The socket for frames."""
        return self.folder / f"{worker}.frames"

    def grpc(self, worker: int) -> Path:
        """The socket for gRPC."""
        return self.folder / f"{worker}.grpc"


def socket_folder(data: Path | None) -> Path:
    """Make a private folder: in the data folder, or a temporary one, without data or if the name would be too long."""
    if data is None or len(str(data.absolute())) > LONGEST_FOLDER:
        return Path(tempfile.mkdtemp(prefix="dynhull-"))
    folder = data.absolute() / "sockets"
    folder.mkdir(exist_ok=True)
    folder.chmod(0o700)
    for left in folder.iterdir():
        left.unlink()
    return folder
