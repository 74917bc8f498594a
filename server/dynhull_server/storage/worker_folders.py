"""A data folder that several workers share: one folder of each, and a manifest that says how many there are."""

import json
import os
import zlib
from pathlib import Path
from typing import Any

from .port import DamagedError, FormatError, StorageError
from .rows.incarnation import new_incarnation
from .sqlite.disk import Disk
from .sqlite.folder import DATABASE, Folder
from .sqlite.origin import is_copied
from .sqlite.storage import SQLiteStorage

MANIFEST = "workers.json"
FORMAT = 1
# How names belong to partitions, and partitions to workers.
PLACEMENT = "crc32(first part of the name) mod 1024 mod workers"


def worker_folder(data: Path, number: int) -> Path:
    """The folder of one worker."""
    return data / f"worker-{number}"


def workers_of(data: Path) -> int | None:
    """The number of workers that a folder is divided among; None if it is that of a server of one process, or missing.

    Raises:
        DamagedError: the manifest, or the folder of a worker, is damaged or missing.
        FormatError: this version does not know the format.
    """
    manifest = _read(data)
    if manifest is None:
        return None
    if manifest["format"] != FORMAT or manifest["placement"] != PLACEMENT:
        raise FormatError(f"{data / MANIFEST} is of a format that this version does not know: use one that does")
    workers: int = manifest["workers"]
    if manifest["complete"]:
        for number in range(workers):
            if not (worker_folder(data, number) / DATABASE).exists():
                raise DamagedError(f"{worker_folder(data, number) / DATABASE} is missing: restore a backup")
    return workers


def parts_of(data: Path) -> list[Path]:
    """The folders with a database each: those of the workers, or the folder itself. Raises StorageError."""
    workers = workers_of(data)
    return [data] if workers is None else [worker_folder(data, number) for number in range(workers)]


def require_one_process(data: Path) -> None:
    """Raise StorageError if a folder is divided among workers."""
    workers = workers_of(data)
    if workers is not None:
        raise StorageError(f"{data} is divided among {workers} workers: start the server with --workers {workers}")


def divide(data: Path, workers: int) -> None:
    """Make a folder for that many workers, or check that it is one.

    Raises:
        StorageError: it is the folder of one process, or of another number of workers.
    """
    if data.is_file():
        raise StorageError(f"{data} is a file, not a data folder")
    present = workers_of(data)
    if present == workers:
        return
    if present is not None:
        raise StorageError(
            f"{data} is divided among {present} workers: start the server with --workers {present}; to change their "
            "number, load the hulls (dynhull export, dynhull load) into a server with another folder"
        )
    if (data / DATABASE).exists():
        raise StorageError(
            f"{data} is the folder of a server of one process: start it without --workers, or load the hulls (dynhull "
            "export, dynhull load) into a server with another folder"
        )
    data.mkdir(parents=True, exist_ok=True)
    write_manifest(data, workers, complete=False)


def begin_anew_if_copied(data: Path, workers: int) -> list[str]:
    """Where one of the databases is a copy of what was served before, make all of them another incarnation: the same.

    A hull over shards has its uid in several of them. Returns messages about what was lost or changed.

    Raises:
        StorageError: one of them cannot be used.
    """
    folders = [worker_folder(data, number) for number in range(workers)]
    notes: list[str] = []
    if any(is_copied(Folder(each, Disk())) for each in folders):
        incarnation = new_incarnation()
        for each in folders:
            storage = SQLiteStorage(each, incarnation=incarnation)
            notes += storage.open(lambda *_: None).notes
            storage.close()
    return notes


def write_manifest(data: Path, workers: int, *, complete: bool) -> None:
    """Write how many workers there are, and whether all have a database: from then on, a missing one is a loss."""
    content = {"format": FORMAT, "placement": PLACEMENT, "workers": workers, "complete": complete}
    text = json.dumps({**content, "checksum": _checksum(content)}) + "\n"
    file = data / MANIFEST
    part = file.with_suffix(".part")
    with part.open("w", encoding="utf-8") as opened:
        opened.write(text)
        opened.flush()
        os.fsync(opened.fileno())
    part.replace(file)
    folder = os.open(data, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)


def _read(data: Path) -> dict[str, Any] | None:
    """The manifest; None if there is neither one nor a folder of a worker."""
    file = data / MANIFEST
    try:
        content: dict[str, Any] = json.loads(file.read_text("utf-8"))
        checksum = content.pop("checksum")
    except FileNotFoundError:
        if any(data.glob("worker-*")):
            raise DamagedError(f"{file} is missing, but {data} has folders of workers: restore a backup") from None
        return None
    except NotADirectoryError:
        return None
    except (ValueError, KeyError, TypeError, AttributeError):
        raise DamagedError(f"{file} is damaged: restore a backup") from None
    if checksum != _checksum(content):
        raise DamagedError(f"{file} is damaged: restore a backup")
    return content


def _checksum(content: dict[str, Any]) -> int:
    return zlib.crc32(json.dumps(content, sort_keys=True).encode())
