"""Lines of JSON, for pipes."""

import json
import math
from typing import Any


def json_line(**members: Any) -> str:
    """An object on one line. NaN and the infinities, which JSON cannot write, become null."""
    return json.dumps(_plain(members), allow_nan=False)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):  # of numpy, which a command may not have imported
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, dict):
        return {name: _plain(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(each) for each in value]
    return value
