"""Who a data folder is, for the past that it keeps elsewhere."""

import socket
from pathlib import Path
from secrets import token_hex

from ..durable import TEMPORARY, make_durable
from ..segments.owner import ID_BYTES, Claimant
from .birth import birth

NOTE, MARKS = "dynhull.owner", "dynhull.marks"


class FolderMarks:
    """The marks of a data folder, a line each: several processes may add one at a time.

    Args:
        data: the folder.
    """

    def __init__(self, data: Path) -> None:
        self._file = data / MARKS

    def known(self) -> set[str]:
        """The marks."""
        return set(self._file.read_text("ascii", "replace").split()) if self._file.exists() else set()

    def add(self, mark: str) -> None:
        """Add one, durably."""
        new = not self._file.exists()
        with self._file.open("a") as opened:
            opened.write(f"{mark}\n")
        make_durable(self._file)
        if new:
            make_durable(self._file.parent)


def owner_of_folder(data: Path) -> Claimant:
    """Who a data folder is: another one if it was copied, which the time at which the file was made tells.

    Raises:
        OSError: the folder cannot be written.
    """
    data.mkdir(parents=True, exist_ok=True)
    file = data / NOTE
    about = f"the data folder {data.resolve()} of {socket.gethostname()}"
    if file.exists():
        known, _, born = file.read_text("ascii", "replace").strip().partition(" ")
        if known and born in ("", str(birth(file) or "")):
            return Claimant(known, about, FolderMarks(data))
    part = file.with_name(file.name + TEMPORARY)
    part.unlink(missing_ok=True)  # a file that was there keeps its time
    new = token_hex(ID_BYTES)
    with part.open("w") as written:
        written.write(f"{new} {birth(part) or ''}".strip() + "\n")
    make_durable(part)
    part.replace(file)
    make_durable(data)
    return Claimant(new, about, FolderMarks(data))
