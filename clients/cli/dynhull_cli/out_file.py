"""The file that a command writes at its end, checked at its beginning."""

from collections.abc import Sequence
from pathlib import Path


def check_out(path: Path, suffixes: Sequence[str]) -> None:
    """Raise ValueError if the name has none of the suffixes, or if its folder does not exist."""
    if path.suffix.lower() not in suffixes:
        *most, last = suffixes
        allowed = f"{', '.join(most)} or {last}" if most else last
        raise ValueError(f"--out {path}: the name must end in {allowed}")
    if not path.parent.is_dir():
        raise ValueError(f"--out {path}: there is no folder {path.parent}")
