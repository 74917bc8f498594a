"""The folder of the past: two files for each segment, written once, and read with the hash of all their bytes."""

import errno
import io
import os
from base64 import b64decode, b64encode
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import blake2b
from importlib.util import find_spec
from pathlib import Path
from secrets import token_hex
from time import time
from typing import NamedTuple

from ..durable import TEMPORARY, make_durable, write_durably
from ..port import DamagedError, StorageError
from .owner import CLAIMS, MARK_BYTES, Claimant, Marks, OccupiedError

BATCHES, STATE = ".batches.parquet", ".state.parquet"
HISTORY = "history"  # the folder within a data folder, unless another one is named
DIGEST_BYTES = 16
ORPHAN_SECONDS = 86_400.0
# Who needs a part of a file reads and checks whole blocks of it: a group of rows is in one or two.
BLOCK, BLOCK_DIGEST_BYTES = 2**16, 8
WAITED = "cannot be read at present: {}"
NEEDS = "needs pyarrow: pip install 'dynhull[history]'"


class Written(NamedTuple):
    """What a file was written with: its size, the hash of its bytes, and those of its blocks, one after the other."""

    bytes: int
    digest: str
    blocks: str


class FileParts(io.RawIOBase):
    """A file that is read in parts. What is read is checked before, whole blocks of it at a time.

    Args:
        size: the bytes of the file.
        load: returns the block with a number, after it is checked.
    """

    def __init__(self, size: int, load: Callable[[int], bytes]) -> None:
        self._size = size
        self._load = load
        self._blocks: dict[int, bytes] = {}
        self._place = 0

    def readable(self) -> bool:
        """It is."""
        return True

    def tell(self) -> int:
        """The place in the file."""
        return self._place

    def seek(self, place: int, whence: int = io.SEEK_SET) -> int:
        """Go to a place."""
        base = {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._size}[whence]
        self._place = min(max(base + place, 0), self._size)
        return self._place

    def read(self, size: int = -1) -> bytes:
        """The bytes from the place on. Raises the errors of `Archive.parts`."""
        start = self._place
        self._place = end = self._size if size < 0 else min(start + size, self._size)
        first = start // BLOCK
        some = b"".join(map(self._block, range(first, -(-end // BLOCK))))
        return some[start - first * BLOCK : end - first * BLOCK]

    def _block(self, number: int) -> bytes:
        if number not in self._blocks:
            self._blocks[number] = self._load(number)
        return self._blocks[number]


def is_installed() -> bool:
    """Whether segments can be written and read here."""
    return find_spec("pyarrow") is not None


class Archive:
    """A folder with the files of segments. Each name is used once, and its file never changed.

    Args:
        path: the folder; it is made with its first file.
        most_bytes: how many bytes of the past of all hulls are kept at most; 0 for any number.
        most_age: for how many microseconds at most any of it is kept; 0 for any time.

    Attributes:
        path, most_bytes, most_age: the same.
        owner: the database that has its past here and nobody else; None where that is nobody's concern, as within a
            data folder.
    """

    owner: Claimant | None = None

    takes_late = False  # whether what was given up may be there later
    has_parts = True  # whether to read a part of a file takes less than to read all of it

    def __init__(self, path: Path, most_bytes: int = 0, most_age: int = 0) -> None:
        self.path = path
        self.most_bytes = most_bytes
        self.most_age = most_age
        self._claimed: Claimant | None = None
        self._own_claim = ""  # the claim that was last found to be the owner's
        self._known_mark = ""  # the next one, until it is in the claim: while a store is away there are no more

    def claim(self) -> None:
        """Have this place for the owner alone. Nothing is written or removed before.

        Raises:
            OccupiedError: another database has it.
            OSError: that cannot be known at present.
        """
        owner = self.owner
        if owner is None or self._claimed == owner:
            return
        self._require_alone(owner)
        if owner.marks is not None:
            self._mark(owner, owner.marks)
        self._claimed = owner

    def _require_alone(self, owner: Claimant) -> None:
        """Claim the place if nobody does. Raises the errors of `claim`."""
        claims = self._claims()
        if not claims:
            if owner.marks is None:
                self._put(f"{CLAIMS}/{owner.id}", owner.about.encode())
            else:
                self._mark(owner, owner.marks)
            claims = self._claims()
            if claims - {owner.id}:  # it came at the same moment, and may have gone
                self._drop(f"{CLAIMS}/{owner.id}")
        self._require_nobody(claims - {owner.id})
        if owner.marks is None:
            return
        content = self.content(f"{CLAIMS}/{owner.id}").decode(errors="replace")
        if content == self._own_claim:  # each file asks, and marks stay known
            return
        # Earlier versions had no mark. A claim with one of ours is ours, also where the store has added to it, or has
        # kept a part of it.
        about, _, last = content.strip().rpartition("\n")
        if about and not any(mark in content or mark.startswith(last) for mark in owner.marks.known()):
            raise OccupiedError(
                f"{self.path} has the past of a copy of this database, or of what this is a copy of, which was served "
                "since: each of the two would remove what the other one needs. Give one of them a --history-dir of "
                "its own, with a copy of the files; or, if the other is never served again, remove "
                f"{CLAIMS}/{owner.id} there"
            )
        self._own_claim = content

    def require_free(self) -> None:
        """Raise OccupiedError if any database has its past here."""
        self._require_nobody(self._claims())

    def _require_nobody(self, others: set[str]) -> None:
        for other in sorted(others):
            about, _, _ = self.content(f"{CLAIMS}/{other}").decode(errors="replace").partition("\n")
            raise OccupiedError(
                f"{self.path} has the past of another database, {about}: each of the two would remove what the other "
                "one needs. Give this one a --history-dir of its own, with a copy of the files if it has a past; or, "
                f"if the other is never served again, remove {CLAIMS}/{other} there"
            )

    def _mark(self, owner: Claimant, marks: Marks) -> None:
        """Put a new mark into the claim, after it is known."""
        if not self._known_mark:
            mark = token_hex(MARK_BYTES)
            marks.add(mark)
            self._known_mark = mark
        self._put(f"{CLAIMS}/{owner.id}", f"{owner.about}\n{self._known_mark}".encode())
        self._known_mark = ""

    def _require_own(self) -> None:
        """Have this place for the owner alone still: a copy may have it by now. Raises the errors of `claim`."""
        self.claim()
        if self.owner is not None and self.owner.marks is not None:
            self._require_alone(self.owner)

    def name(self, uid: str, first: int, last: int, epoch: int = 0) -> str:
        """A name for the files of a segment that no other one has; `epoch` is that of the owner of the hull."""
        return f"{uid}/{first:019}-{last:019}-{epoch}-{token_hex(8)}"

    def write(self, file: str, content: bytes) -> Written:
        """Write a file so that it is whole and on the disk under its name, or not there.

        Raises:
            OSError: the disk is full, or fails.
            OccupiedError: the past of another database is here, which would remove it.
        """
        self._require_own()
        self._put(file, content)
        return written(content)

    def _put(self, file: str, content: bytes) -> None:
        path = self.path / file
        for folder in (self.path, path.parent):
            if not folder.is_dir():
                folder.mkdir(parents=True, exist_ok=True)
                make_durable(folder.parent)
        write_durably(path, content)

    def _drop(self, file: str) -> None:
        (self.path / file).unlink(missing_ok=True)

    def _claims(self) -> set[str]:
        """The names of those who claim this place."""
        folder = self.path / CLAIMS
        return (
            {each.name for each in folder.iterdir() if not each.name.endswith(TEMPORARY)} if folder.is_dir() else set()
        )

    def read(self, file: str, wrote: Written) -> bytes:
        """All bytes of a file.

        Raises:
            DamagedError: they are not those that were written.
            StorageError: the file cannot be read at present.
        """
        with self._reading(file):
            content = self._for_reader(file, wrote.bytes)
        if len(content) != wrote.bytes or digest_of(content) != wrote.digest:
            raise _changed(self.path / file)
        return content

    @contextmanager
    def parts(self, file: str, wrote: Written) -> Iterator[io.IOBase]:
        """A file that is read in parts. What is read of it is checked; and all, where its blocks have no hashes.

        Raises:
            DamagedError: the bytes are not those that were written; also when they are read.
            StorageError: the file cannot be read at present.
        """
        if not self.has_parts or not wrote.blocks:
            yield io.BytesIO(self.read(file, wrote))
            return
        path, digests = self.path / file, b64decode(wrote.blocks)
        with self._reading(file), _opened(path) as opened:
            if os.fstat(opened.fileno()).st_size != wrote.bytes:
                raise _changed(path)

            def load(number: int) -> bytes:
                with self._reading(file):
                    block = os.pread(opened.fileno(), BLOCK, number * BLOCK)
                if _digests_of(block) != digests[number * BLOCK_DIGEST_BYTES : (number + 1) * BLOCK_DIGEST_BYTES]:
                    raise _changed(path)
                return block

            yield FileParts(wrote.bytes, load)

    @contextmanager
    def _reading(self, file: str) -> Iterator[None]:
        try:
            yield
        except FileNotFoundError:
            raise DamagedError(f"{self.path / file} is missing: restore a backup") from None
        except OSError as error:
            why = WAITED.format(error.strerror) if error.errno == errno.ETIMEDOUT else "cannot be read at present"
            raise StorageError(f"{self.path / file} cannot be read: {error}", for_callers=why) from error

    def _for_reader(self, file: str, size: int) -> bytes:
        """The same as `content`, for who waits for it."""
        return self.content(file, size)

    def content(self, file: str, size: int = 0) -> bytes:
        """All bytes of a file, whatever they are; no more than one byte more than a size, if that is not 0.

        Raises:
            FileNotFoundError: it is not there.
            OSError: it cannot be read at present.
        """
        with _opened(self.path / file) as content:
            return content.read(size + 1) if size else content.read()

    def remove(self, file: str) -> None:
        """Remove the files of a segment; those that are not there are passed over.

        Raises:
            OSError: one cannot be removed.
            OccupiedError: the past of another database is here.
        """
        self._require_own()
        path = self.path / file
        for end in (BATCHES, STATE):
            for name in (path.name + end, path.name + end + TEMPORARY):
                path.with_name(name).unlink(missing_ok=True)
        with suppress(OSError):  # others are in it, or it is gone
            path.parent.rmdir()

    def adopt(self, other: "Archive", file: str) -> None:
        """Have the files of a segment of another archive, as links where that is possible.

        Raises:
            OSError: they are not there, or cannot be copied.
        """
        for each in other.files(file):
            if not self._link(other, each):
                self.write(each, other.content(each))

    def _link(self, other: "Archive", file: str) -> bool:
        """Have a file of another archive as a link; whether that is possible."""
        if type(self) is not Archive or type(other) is not Archive:
            return False
        target = self.path / file
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            os.link(other.path / file, target)
        except FileNotFoundError:
            raise
        except OSError:  # another file system, or one without links
            return False
        return True

    def has(self, file: str) -> bool:
        """Whether any file of a segment is there."""
        return any((self.path / (file + end)).exists() for end in (BATCHES, STATE))

    def files(self, file: str) -> Iterator[str]:
        """The names of the files of a segment that are there."""
        yield file + BATCHES
        if (self.path / (file + STATE)).exists():
            yield file + STATE

    def orphans(self, uid: str, epoch: int) -> list[str]:
        """Segments older than a day that owners before an epoch have written.

        A hull may have those of owners before.

        Raises:
            OSError: that cannot be read.
        """
        before = time() - ORPHAN_SECONDS
        return sorted({file for file, changed in self._times(uid) if changed < before and _epoch(file) < epoch})

    def _times(self, uid: str) -> Iterator[tuple[str, float]]:
        """The segments of a hull, once for each file, and when that was written."""
        folder = self.path / uid
        for each in folder.iterdir() if folder.is_dir() else ():
            yield f"{uid}/{each.name.partition('.')[0]}", each.stat().st_mtime

    def sync(self) -> None:
        """Make the names of all files durable."""
        for folder in [self.path.parent, self.path, *(each for each in self.path.iterdir() if each.is_dir())]:
            make_durable(folder)


def _opened(path: Path) -> io.BufferedReader:
    """A file to read. Raises OSError if it is a pipe, which would let nobody go, or a device, which may have no end."""
    if path.exists() and not path.is_file():
        raise OSError(errno.EINVAL, "it is no file", str(path))
    return path.open("rb")


def written(content: bytes) -> Written:
    """What to know of a file with this content."""
    return Written(len(content), digest_of(content), b64encode(_digests_of(content)).decode())


def digest_of(content: bytes) -> str:
    """The hash of the bytes of a file."""
    return blake2b(content, digest_size=DIGEST_BYTES).hexdigest()


def _digests_of(content: bytes) -> bytes:
    """The hashes of the blocks of a file, or of some of them."""
    blocks = (content[start : start + BLOCK] for start in range(0, len(content), BLOCK))
    return b"".join(blake2b(block, digest_size=BLOCK_DIGEST_BYTES).digest() for block in blocks)


def _epoch(file: str) -> int:
    """The epoch in the name of a segment; that of one without it is that of nobody."""
    parts = file.rpartition("/")[2].split("-")
    return int(parts[2]) if len(parts) == 4 and parts[2].isdigit() else 0


def _changed(path: Path) -> DamagedError:
    return DamagedError(f"{path} is not as it was written: it was cut, changed or exchanged: restore a backup")
