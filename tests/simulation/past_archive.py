"""The files of the past on a disk or in an object store that fail when the plan says so, and between whose steps a
server may be killed."""

import errno
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from io import BytesIO, IOBase
from itertools import count
from pathlib import Path
from time import time
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch
from zlib import crc32

from dynhull_server.storage.durable import TEMPORARY
from dynhull_server.storage.rows import filed
from dynhull_server.storage.rows import storage as rows_storage
from dynhull_server.storage.segments import archive, objects
from dynhull_server.storage.segments.archive import BATCHES, STATE, Archive, Written
from dynhull_server.storage.segments.owner import CLAIMS

from .machine import SimulatedThreads, reading_ahead

# Where the disk may fail, or the server be killed: before a file is written, where a part of it is there, and where it
# is there, and nobody knows; before a file is read; before the files of a segment are removed, and between them.
FILE_PLACES = ("file", "part", "filed", "fetch", "unlink", "unlinked")
# Where the store may: before it has a call, or is sent a file, and where it has carried it out, and nobody knows.
STORE_PLACES = ("call", "call", "send", "send", "answer")

# What may have become of a file: a bit of it is another one, half of it is there, it is away, or another file is in its
# place.
DAMAGE = ("flip", "half", "gone", "other")
# How a call of a store ends late: it is carried out when nobody waits for it any more, or never, or after a while.
LATE = ("late", "hung", "slow")

# Seconds after which a call that was late is carried out, and turns of others while one is slow.
LATER, SLOW = 1.5, 20
# Seconds, which are calls here, after which files in a store that belong to nobody are removed; seconds from one look
# for them to the next; and those after which nothing is carried out that was given up.
OLD, LOOK, LATEST = 5.0, 2.0, 3.0

At = Callable[[str], str | None]


class FaultyArchive(Archive):
    """A folder of segments.

    Args:
        path: the folder.
        most_bytes: how many bytes are kept at most; 0 for any number.
        at: called at each of `FILE_PLACES`; returns what has become of a file that is read.
    """

    def __init__(self, path: Path, most_bytes: int, at: At) -> None:
        super().__init__(path, most_bytes)
        self._at = at
        self._damaged = 0

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
        with self._damage(file, self._at("fetch")):
            return super().content(file, size)

    @contextmanager
    def parts(self, file: str, wrote: Written) -> Iterator[IOBase]:
        """Read a file in parts."""
        with self._damage(file, self._at("fetch")), super().parts(file, wrote) as parts:
            yield parts

    @contextmanager
    def _damage(self, file: str, kind: str | None) -> Iterator[None]:
        """Have a file damaged while it is read. Other folders may have it as a link: it is not touched itself."""
        path = self.path / file
        aside = path.with_name(path.name + ".aside")
        if kind not in DAMAGE or not path.exists():
            yield
            return
        path.rename(aside)
        try:
            content = damaged(aside.read_bytes(), kind, self._damaged, others(self.path, path))
            self._damaged += 1
            if content is not None:
                path.write_bytes(content)
            yield
        finally:
            aside.replace(path)

    def remove(self, file: str) -> None:
        """Remove the files of a segment."""
        self._at("unlink")
        (self.path / (file + BATCHES)).unlink(missing_ok=True)
        self._at("unlinked")
        super().remove(file)

    def _times(self, _: str) -> Iterator[tuple[str, float]]:
        """When files were written, by the clock of the machine: no life lasts for a day."""
        return iter(())

    def names(self) -> set[str]:
        """The names of the segments of which there is any file, also a part of one."""
        return names_in(self.path)


@dataclass
class Store:
    """What is in an object store: it outlives the servers, as do calls that they have given up.

    Attributes:
        folder: has the objects as files.
        elapsed: the seconds that have passed. Nobody sets the clock of a store together with that of a server.
        times: the number of calls that had come when each of them was written; a second is a call here.
        writers: who has written each of them: the past of a database, or None.
        claims: who claimed the store, and after how many calls, one after the other.
        late: calls that are carried out later: when, and what they do.
        calls: how many there were.
    """

    folder: Path
    elapsed: Callable[[], float]
    times: dict[str, int] = field(default_factory=dict)
    writers: dict[str, object] = field(default_factory=dict)
    claims: list[tuple[int, object]] = field(default_factory=list)
    late: list[tuple[float, Callable[[], Any]]] = field(default_factory=list)
    calls: int = 0

    def called(self) -> None:
        """One more call comes; what was late may be carried out now."""
        self.calls += 1
        now = self.elapsed()
        due = [call for when, call in self.late if when <= now]
        self.late = [each for each in self.late if each[0] > now]
        for call in due:
            call()

    def wrote(self, path: Path, writer: object) -> None:
        """An object is there."""
        self.times[path.name], self.writers[path.name] = self.calls, writer
        if path.parent.name == CLAIMS:
            self.claims.append((self.calls, writer))

    def owner(self, calls: int) -> object:
        """Who had claimed the store last, after so many calls."""
        return next((owner for number, owner in reversed(self.claims) if number <= calls), None)

    def apart(self, folder: Path) -> "Store":
        """Its objects in another store, without the claims."""
        if self.folder.is_dir():
            shutil.copytree(self.folder, folder, ignore=shutil.ignore_patterns(CLAIMS))
        return Store(folder, self.elapsed, self.times.copy(), self.writers.copy(), calls=self.calls)


class FaultyStore(objects.ObjectArchive):
    """A store of segments: the calls of the real archive come to it one after the other.

    Args:
        store: what is in it.
        most_bytes: how many bytes are kept at most; 0 for any number.
        at: called at each of `STORE_PLACES`; returns what becomes of the call.
        give_way: lets others go on.
        writer: whose past it is.
    """

    def __init__(
        self, store: Store, most_bytes: int, at: At, give_way: Callable[[], None], writer: object = None
    ) -> None:
        super().__init__("s3://bucket", most_bytes)
        self._kept, self._at, self._give_way = store, at, give_way
        self._sends = False
        self._made: Any = _FileSystem(store, self.path, writer)
        self._damaged = 0

    def _put(self, file: str, content: bytes) -> None:
        self._sends = True
        super()._put(file, content)

    def _ask(self, what: str, function: Callable[[], Any], seconds: float, size: int = 0) -> Any:
        del seconds, size
        sends, self._sends = self._sends, False
        kind = self._at("send" if sends else "call")
        self._kept.called()
        if kind == "late":
            self._kept.late.append((self._kept.elapsed() + LATER, lambda: _forgotten(function)))
        for _ in range(SLOW if kind in LATE else 0):
            self._give_way()
        if kind in ("late", "hung"):
            raise OSError(errno.ETIMEDOUT, "the store does not answer, as planned", what)
        self._made.torn = kind == "torn"
        found = function()
        self._at("answer")
        if kind in DAMAGE and isinstance(found, bytes):
            found = damaged(found, kind, self._damaged, others(self._kept.folder, self._kept.folder / what))
            self._damaged += 1
            if found is None:
                raise FileNotFoundError(what)
        return found

    def names(self) -> set[str]:
        """The names of the segments of which there is any object."""
        return names_in(self._kept.folder)


class _FileSystem:
    """What an `ObjectArchive` needs of pyarrow's file systems; `torn` is whether it keeps half of what it is sent."""

    def __init__(self, store: Store, root: Path, writer: object) -> None:
        self._store, self._root, self._writer = store, root, writer
        self.torn = False

    def _file(self, key: str) -> Path:
        return self._store.folder / Path(key).relative_to(self._root)

    @contextmanager
    def open_output_stream(self, key: str) -> Iterator[BytesIO]:
        content = BytesIO()
        yield content
        path = self._file(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        sent = content.getvalue()
        path.write_bytes(sent[: len(sent) // 2] if self.torn else sent)
        self._store.wrote(path, self._writer)

    def open_input_file(self, key: str) -> BytesIO:
        return BytesIO(self._file(key).read_bytes())

    def delete_file(self, key: str) -> None:
        self._file(key).unlink()

    def get_file_info(self, asked: Any) -> Any:
        """About one object, or all below a folder."""
        from pyarrow.fs import FileType

        if isinstance(asked, str):
            return SimpleNamespace(type=FileType.File if self._file(asked).exists() else FileType.NotFound)
        folder, now = self._file(asked.base_dir), time()
        return [
            SimpleNamespace(type=FileType.File, base_name=each.name, mtime=datetime.fromtimestamp(now - age, UTC))
            for each in (sorted(folder.iterdir()) if folder.is_dir() else ())
            if (age := self._store.calls - self._store.times[each.name]) >= 0
        ]


def _forgotten(function: Callable[[], Any]) -> None:
    """Carry out a call that nobody waits for."""
    try:
        function()
    except OSError:
        return


def others(folder: Path, file: Path) -> list[Path]:
    """The files of other segments that are there, of the same kind."""
    return [each for each in sorted(folder.glob(f"*/*.{file.name.partition('.')[2]}")) if each != file]


def damaged(content: bytes, kind: str, nth: int, other: Sequence[Path]) -> bytes | None:
    """What has become of a file, in whose place another one may be; None if it is away."""
    match kind:
        case "flip":
            changed = bytearray(content)
            bit = crc32(content, nth) % (8 * len(content))
            changed[bit // 8] ^= 1 << bit % 8
            return bytes(changed)
        case "half":
            return content[: len(content) // 2]
        case "other":
            return other[crc32(content, nth) % len(other)].read_bytes() if other else content[::-1]
        case _:
            return None


def names_in(folder: Path) -> set[str]:
    """The names of the segments of which there is any file."""
    folders = folder.iterdir() if folder.is_dir() else ()
    found = (f"{each.name}/{file.name}" for each in folders for file in each.iterdir())
    return {name.removesuffix(TEMPORARY).removesuffix(BATCHES).removesuffix(STATE) for name in found}


@contextmanager
def simulated_reading(threads: Callable[[], SimulatedThreads], elapsed: Callable[[], float]) -> Iterator[None]:
    """Have segments read ahead by simulated threads, named by numbers, and stores cleared within simulated seconds."""
    thread, future = reading_ahead(threads)
    numbers = count()
    with (
        patch.object(archive, "token_hex", lambda size: f"{next(numbers):0{2 * size}}"),
        patch.object(filed, "Thread", thread),
        patch.object(filed, "Future", future),
        patch.object(archive, "ORPHAN_SECONDS", OLD),
        patch.object(rows_storage, "monotonic", elapsed),
        patch.object(rows_storage, "LOOK", LOOK),
        patch.object(rows_storage, "LATE", LATEST),
    ):
        yield
