"""No test sleeps: who waits for something uses `patience`, and who lets an hour pass `set_time`."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).parents[1]
MENTIONED = re.compile(r"sleep|Timer|wait_for_timeout")
# Files that may sleep, each with its reason.
EXCEPTIONS = {
    "bridges/test_webhooks.py": "receivers that are slow to answer",
    "robustness/bridges/ingest_torture.py": "faults come at moments of chance",
    "robustness/bridges/relay_torture.py": "faults come at moments of chance",
    "server/faulty.py": "a commit hangs in a process that knows nothing of the tests",
    "server/left.py": "gRPC says nowhere that it has heard of a departure",
    "simulation/machine.py": "the time is simulated",
    "simulation/shell_life.py": "the time is simulated",
    "support/pacing.py": "pauses that are input, such as those between faults",
    "support/patience.py": "looks again and again for what has to come",
}


def sleeps(source: str) -> Iterator[int]:
    """The lines that let some time pass, and not only others go on, as sleep(0) does."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            gives_way = [each.value for each in node.args if isinstance(each, ast.Constant)] == [0]
            if called in {"Timer", "wait_for_timeout"} or (called == "sleep" and not gives_way):
                yield node.lineno


def test_no_test_sleeps() -> None:
    ours = [each for each in TESTS.rglob("*.py") if "node_modules" not in each.parts]
    mentioning = {each: text for each in ours if MENTIONED.search(text := each.read_text())}
    found = {
        each.relative_to(TESTS).as_posix(): lines
        for each, text in mentioning.items()
        if each != Path(__file__) and (lines := [*sleeps(text)])
    }
    assert {file: lines for file, lines in found.items() if file not in EXCEPTIONS} == {}
    assert EXCEPTIONS.keys() <= found.keys()  # those without a sleep need no exception


def test_what_is_a_sleep() -> None:
    waits = "time.sleep(0.1)", "sleep(x)", "await asyncio.sleep(1)", "threading.Timer(1, f)", "p.wait_for_timeout(9)"
    goes_on = "time.sleep(0)", "await asyncio.sleep(0)", "sleeps(1)", "time.sleep"
    assert [[*sleeps(each)] for each in (*waits, *goes_on)] == [[1]] * len(waits) + [[]] * len(goes_on)
