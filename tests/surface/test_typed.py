"""The program that `make check` has read by two type checkers makes every call."""

import ast
from pathlib import Path

from dynhull_client import HullClient

PROGRAM = Path(__file__).parent / "typed_program.py"
CALLS = [name for name in dir(HullClient) if not name.startswith("_") and callable(getattr(HullClient, name))]
OF_EVERY_OBJECT = {"close", "with_token"}  # of the connection: they call nothing


def test_every_call_is_checked() -> None:
    made = {
        each.func.attr
        for each in ast.walk(ast.parse(PROGRAM.read_text()))
        if isinstance(each, ast.Call) and isinstance(each.func, ast.Attribute)
    }
    assert set(CALLS) - made == OF_EVERY_OBJECT
