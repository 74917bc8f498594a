"""How far positions may be from where their keys really are."""

from typing import Any

import numpy as np
import numpy.typing as npt

DOUBLE = np.dtype("<f8")


def as_accuracies(accuracies: Any, rows: int) -> npt.NDArray[np.float64]:
    """Accuracies as numbers; ValueError names the first bad row."""
    try:
        found = np.atleast_1d(np.asarray(accuracies, np.float64))
    except (TypeError, ValueError):
        raise ValueError("accuracies must be numbers, one for each key") from None
    if found.shape != (rows,):
        raise ValueError(f"there are {rows} keys and {found.size} accuracies")
    bad = ~((found >= 0) & (found < np.inf))
    if bad.any():
        row = int(np.argmax(bad))
        raise ValueError(f"accuracies row {row} is {found[row]}: must be finite and not negative")
    return found


def decode_accuracies(message: Any) -> npt.NDArray[np.float64] | None:
    """The accuracies of positions in a message; None if it has none."""
    if not message.HasField("accuracies"):
        return None
    found = message.accuracies
    if found.packed:
        return np.frombuffer(found.packed, DOUBLE).astype(np.float64)
    return np.array(found.values, np.float64)
