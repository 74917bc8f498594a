"""The past in an object store: the files of segments as objects, each written once under a key of its own.

A store has no rename and no sync, and what a server has sent before another one took its place may arrive later. So no
key is used twice: it has the uid of the hull, the revisions, the epoch of the owner, and a random number. Only the row
in the journal makes an object part of the past.

A store may hang for as long as it likes. Every call has a thread of its own, a limited number at a time, and is given
up after some time, so that no thread of the disk and no commit ever waits for a store.
"""

from __future__ import annotations

import errno
from concurrent.futures import Future
from concurrent.futures import TimeoutError as TooLongError
from functools import partial
from pathlib import Path
from threading import BoundedSemaphore, Lock, Thread
from time import monotonic
from typing import TYPE_CHECKING, Any, TypeVar
from urllib.parse import parse_qs, unquote, urlsplit

from .archive import BATCHES, STATE, Archive
from .owner import CLAIMS
from .place import is_store, require_store

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from pyarrow.fs import FileInfo, FileSystem

Result = TypeVar("Result")

CONNECT_SECONDS, SILENT_SECONDS = 5.0, 5.0
# Seconds for a call, and bytes in each further one.
CALL_SECONDS, SLOWEST_BYTES = 30.0, 250_000
CALLS = 8  # at a time, also of those that were given up and hang
# Who reads the past of a hull waits for an answer: less than clients wait by default, also behind another one. After a
# read that was given up, others are for some time refused with the same words, so that they do not wait one by one.
READ_SECONDS, REST_SECONDS = 10.0, 5.0


def archive_at(place: str | Path, most_bytes: int = 0, most_age: int = 0) -> Archive:
    """The past in a folder, or in an object store."""
    if is_store(place):
        require_store(str(place))
        return ObjectArchive(str(place), most_bytes, most_age)
    return Archive(Path(place), most_bytes, most_age)


class ObjectArchive(Archive):
    """An object store with the files of segments.

    Args:
        place: its address, without credentials.
        most_bytes, most_age: as of other archives.
        seconds: for a call.

    Attributes:
        rest: for how many seconds reads are refused at once after one that was given up.
    """

    rest = 0.0

    takes_late = True
    has_parts = False  # an object is asked for once

    def __init__(self, place: str, most_bytes: int = 0, most_age: int = 0, seconds: float = CALL_SECONDS) -> None:
        parts = urlsplit(place)
        root = f"{parts.netloc}{unquote(parts.path)}".rstrip("/")
        super().__init__(Path(root), most_bytes, most_age)
        self._options = {name: values[-1] for name, values in parse_qs(parts.query).items()}
        self._seconds = seconds
        self._places = BoundedSemaphore(CALLS)
        self._making = Lock()
        self._made: FileSystem | None = None
        self._away: tuple[float, OSError] | None = None  # until when reads are refused, and why

    def _put(self, file: str, content: bytes) -> None:
        """Write an object, and read it: what comes back is what was sent, also of a claim.

        Raises:
            OSError: the store refuses it, does not answer, or keeps something else.
        """

        def put() -> None:
            with self._store().open_output_stream(self._key(file)) as stream:
                stream.write(content)

        self._ask(file, put, self._seconds, len(content))
        if self.content(file, len(content)) != content:
            raise OSError(errno.EIO, "the object store does not keep what it is sent", file)

    def _drop(self, file: str) -> None:
        self._ask(file, partial(self._removed, self._key(file)), self._seconds)

    def _claims(self) -> set[str]:
        return {each.base_name for each in self._listed(CLAIMS)}

    def _listed(self, folder: str) -> list[FileInfo]:
        """The objects directly in a folder."""
        from pyarrow.fs import FileSelector, FileType

        def look() -> list[FileInfo]:
            found = self._store().get_file_info(FileSelector(self._key(folder), allow_not_found=True))
            return [each for each in found if each.type == FileType.File]

        return self._ask(folder, look, self._seconds)

    def content(self, file: str, size: int = 0) -> bytes:
        """All bytes of an object, whatever they are; no more than one byte more than a size, if that is not 0.

        Raises:
            FileNotFoundError: it is not there.
            OSError: the store refuses, or does not answer.
        """
        return self._ask(file, partial(self._get, file, size), self._seconds, size)

    def _for_reader(self, file: str, size: int) -> bytes:
        away = self._away
        if away is not None and monotonic() < away[0]:
            raise away[1].with_traceback(None)  # else it gets longer with each reader
        try:
            found = self._ask(file, partial(self._get, file, size), min(READ_SECONDS, self._seconds), size)
        except OSError as error:
            if error.errno == errno.ETIMEDOUT:
                self._away = monotonic() + self.rest, error
            raise
        self._away = None
        return found

    def _get(self, file: str, size: int) -> bytes:
        with self._store().open_input_file(self._key(file)) as stream:
            found: bytes = stream.read(size + 1 if size else None)
        return found

    def remove(self, file: str) -> None:
        """Remove the objects of a segment; those that are not there are passed over.

        Raises:
            OSError: one cannot be removed.
        """
        self._require_own()
        for end in (BATCHES, STATE):
            self._drop(file + end)

    def has(self, file: str) -> bool:
        """Whether any object of a segment is there."""
        return any(
            self._ask(file, partial(self._is_there, self._key(file + end)), self._seconds) for end in (BATCHES, STATE)
        )

    def files(self, file: str) -> Iterator[str]:
        """The names of the objects of a segment that are there."""
        yield file + BATCHES
        if self._ask(file, lambda: self._is_there(self._key(file + STATE)), self._seconds):
            yield file + STATE

    def _times(self, uid: str) -> Iterator[tuple[str, float]]:
        """The segments of a hull, once for each object, and when that was written. Raises the errors of `content`."""
        for each in self._listed(uid):
            if each.mtime is not None:
                yield f"{uid}/{each.base_name.partition('.')[0]}", each.mtime.timestamp()

    def sync(self) -> None:
        """Nothing is left to do: a store that has taken an object keeps it."""

    def _key(self, file: str) -> str:
        return f"{self.path}/{file}"

    def _store(self) -> FileSystem:
        with self._making:
            if self._made is None:
                from pyarrow.fs import S3FileSystem

                # One request for each object: no parts are left of one that was given up.
                self._made = S3FileSystem(
                    connect_timeout=CONNECT_SECONDS,
                    request_timeout=SILENT_SECONDS,
                    allow_delayed_open=True,
                    background_writes=False,
                    **self._options,
                )
            return self._made

    def _removed(self, key: str) -> None:
        try:
            self._store().delete_file(key)
        except FileNotFoundError:
            return
        except OSError:
            if self._is_there(key):  # not only the mark of its folder could not be written
                raise

    def _is_there(self, key: str) -> bool:
        from pyarrow.fs import FileType

        return bool(self._store().get_file_info(key).type != FileType.NotFound)

    def _ask(self, what: str, function: Callable[[], Result], seconds: float, size: int = 0) -> Result:
        """The result of a function that asks the store for so many bytes, in a thread of its own.

        Raises:
            OSError: there is none in time, or too many calls hang; or what the function raises.
        """
        seconds += size / SLOWEST_BYTES
        until = monotonic() + seconds
        late = OSError(errno.ETIMEDOUT, f"the object store has not answered for {seconds:.0f} s", what)
        if not self._places.acquire(timeout=seconds):
            raise late
        answer: Future[Result] = Future()
        # It must not keep the process from ending.
        calling = Thread(target=self._call, args=(function, answer), name="object store", daemon=True)
        try:
            calling.start()
        except RuntimeError as error:
            self._places.release()
            raise OSError(errno.EAGAIN, str(error), what) from None
        try:
            return answer.result(max(0.0, until - monotonic()))
        except TooLongError:
            raise late from None

    def _call(self, function: Callable[[], Any], answer: Future[Any]) -> None:
        try:
            answer.set_result(function())
        except BaseException as error:
            answer.set_exception(error)
        finally:
            self._places.release()
