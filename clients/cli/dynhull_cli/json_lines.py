"""Lines of JSON, for pipes."""

import json
import math
from dataclasses import is_dataclass
from datetime import datetime, timedelta
from typing import Any


def json_line(**members: Any) -> str:
    """An object on one line: dataclasses as objects, times as ISO 8601, time spans in seconds.

    NaN and the infinities, which JSON cannot write, become null.
    """
    return json.dumps(_plain(members), allow_nan=False)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # of numpy, which a command may not have imported
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, datetime):
        return value.isoformat()
    if isinstance(value, timedelta):
        return value.total_seconds()
    if is_dataclass(value):
        value = members(value)
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value


def members(value: Any) -> dict[str, Any]:
    """The fields of a dataclass by name."""
    return {name: getattr(value, name) for name in value.__dataclass_fields__}
