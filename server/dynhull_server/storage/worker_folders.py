"""A data folder that several workers share: one folder of each, and a manifest that says how many there are."""

import json
import os
from pathlib import Path

from .port import FormatError, StorageError

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
        FormatError: the manifest cannot be used.
    """
    file = data / MANIFEST
    try:
        found = json.loads(file.read_text("utf-8"))
        version, placement, workers = found["format"], found["placement"], found["workers"]
    except FileNotFoundError:
        if any(data.glob("worker-*")):
            raise FormatError(f"{file} is missing, but {data} has folders of workers: restore a backup") from None
        return None
    except NotADirectoryError:
        return None
    except (ValueError, KeyError, TypeError):
        raise FormatError(f"{file} is damaged: restore it from a backup") from None
    if version != FORMAT or placement != PLACEMENT:
        raise FormatError(f"{file} is of a format that this version does not know: use the version that wrote it")
    if not isinstance(workers, int) or workers < 1:
        raise FormatError(f"{file} is damaged: restore it from a backup")
    return workers


def require_one_process(data: Path) -> None:
    """Raise StorageError if a folder is divided among workers."""
    workers = workers_of(data)
    if workers is not None:
        raise StorageError(f"{data} is divided among {workers} workers: start the server with --workers {workers}")


def divide(data: Path, workers: int) -> None:
    """Make a folder for so many workers, or check that it is one.

    Raises:
        StorageError: it is the folder of one process, or of another number of workers.
    """
    present = workers_of(data)
    if present == workers:
        return
    if present is not None:
        raise StorageError(
            f"{data} is divided among {present} workers: start the server with --workers {present}; to change their "
            "number, load the hulls (dynhull export, dynhull load) into a server with another folder"
        )
    if data.is_file():
        raise StorageError(f"{data} is a file, not a data folder")
    if any(data.glob("dynhull.db*")):
        raise StorageError(
            f"{data} is the folder of a server of one process: start it without --workers, or load the hulls (dynhull "
            "export, dynhull load) into a server with another folder"
        )
    data.mkdir(parents=True, exist_ok=True)
    manifest = {"format": FORMAT, "placement": PLACEMENT, "workers": workers}
    _write(data / MANIFEST, json.dumps(manifest) + "\n")


def _write(file: Path, text: str) -> None:
    """Write a file that is on the disk whole, or not at all."""
    part = file.with_suffix(".part")
    with part.open("w", encoding="utf-8") as opened:
        opened.write(text)
        opened.flush()
        os.fsync(opened.fileno())
    part.replace(file)
    folder = os.open(file.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
