"""The batches of a feed as JSON and as text."""

from datetime import UTC
from typing import Any

import numpy as np

from dynhull_client import FeedBatch, FeedHeld

from .json_lines import members

ALWAYS = "type", "hull", "revision", "uid"  # whatever the value
TIMES = "times", "expire_times"


def batch_members(batch: FeedBatch) -> dict[str, Any]:
    """A batch as members of JSON: those that it has."""
    after = batch.after.hex() if isinstance(batch.after, bytes) else None
    found = _members(batch) | {"after": after, "cause": batch.cause if batch.type == "batch" else None}
    if batch.held is not None:
        found["held"] = _held(batch.held)
    return {name: value for name, value in found.items() if name in ALWAYS or (value is not None and _is_there(value))}


def batch_cells(batch: FeedBatch) -> tuple[str, ...]:
    """Hull, revision, time, what it is or its cause, and the number of points that it puts, removes or expires."""
    time = "" if batch.time is None else batch.time.isoformat(timespec="milliseconds")
    if batch.type in ("deleted", "hulls"):
        return batch.hull, "", time, batch.type, "", ""
    if batch.type == "lost":
        return batch.hull, str(batch.revision), time, f"lost {batch.first}-{batch.last}", "", ""
    put, removed = len(batch.keys) + len(batch.inserts), len(batch.removed) + len(batch.deletes) + batch.expired
    return batch.hull, str(batch.revision), time, batch.cause, str(put), str(removed)


def _members(value: FeedBatch | FeedHeld) -> dict[str, Any]:
    """The fields by name, arrays as lists, and times as ISO 8601."""
    found = members(value)
    for name in TIMES:
        if found.get(name) is not None:
            found[name] = [each and each.replace(tzinfo=UTC).isoformat() for each in found[name].tolist()]
    return {name: each.tolist() if isinstance(each, np.ndarray) else each for name, each in found.items()}


def _held(held: FeedHeld) -> dict[str, Any]:
    found = _members(held)
    rules = None if held.rules is None else members(held.rules)
    return {name: value for name, value in (found | {"rules": rules}).items() if value is not None}


def _is_there(value: Any) -> bool:
    return bool(len(value)) if isinstance(value, list | tuple) else bool(value)
