"""Files and folders that outlive a crash of the machine."""

import os
from pathlib import Path

TEMPORARY = ".part"  # the end of the name of a file that is being written


def write_durably(file: Path, content: bytes) -> None:
    """Give a file this content; after a crash it has this or what was there before.

    Raises:
        OSError: the disk is full, or fails.
    """
    part = file.with_name(file.name + TEMPORARY)
    part.write_bytes(content)
    make_durable(part)
    part.replace(file)
    make_durable(file.parent)


def make_durable(path: Path) -> None:
    """Sync the content of a file, or the names in a folder."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
