"""The files of the past on a disk that fails when the plan says so, and between whose steps a server may be killed."""

from collections.abc import Callable
from pathlib import Path

from dynhull_server.storage.durable import TEMPORARY
from dynhull_server.storage.segments.archive import BATCHES, STATE, Archive, Written

# Where the disk may fail, or the server be killed: before a file is written, where a part of it is there, and where it
# is there, and nobody knows; before a file is read; before the files of a segment are removed, and between them.
FILE_PLACES = ("file", "part", "filed", "fetch", "unlink", "unlinked")


class FaultyArchive(Archive):
    """A folder of segments.

    Args:
        path: the folder.
        most_bytes: how many bytes are kept at most; 0 for any number.
        at: called at each of `FILE_PLACES`.
    """

    def __init__(self, path: Path, most_bytes: int, at: Callable[[str], None]) -> None:
        super().__init__(path, most_bytes)
        self._at = at

    def write(self, file: str, content: bytes) -> Written:
        """Write a file."""
        self._at("file")
        path = self.path / (file + TEMPORARY)
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content[: len(content) // 2])
        self._at("part")
        written = super().write(file, content)
        self._at("filed")
        return written

    def content(self, file: str, size: int = 0) -> bytes:
        """Read a file."""
        self._at("fetch")
        return super().content(file, size)

    def remove(self, file: str) -> None:
        """Remove the files of a segment."""
        self._at("unlink")
        (self.path / (file + BATCHES)).unlink(missing_ok=True)
        self._at("unlinked")
        super().remove(file)

    def names(self) -> set[str]:
        """The names of the segments of which there is any file, also a part of one."""
        found = (path.relative_to(self.path).as_posix() for path in self.path.glob("*/*"))
        return {name.removesuffix(TEMPORARY).removesuffix(BATCHES).removesuffix(STATE) for name in found}
