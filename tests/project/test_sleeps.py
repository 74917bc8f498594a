"""No test sleeps: who waits for something uses `patience`, and who lets an hour pass `set_time`.

A short wait on an event is a sleep, too: that nothing has come within it says little on a slow machine.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

TESTS = Path(__file__).parents[1]
MENTIONED = re.compile(r"sleep|Timer|wait|join")
SHORT = 5  # seconds: a longer wait is for what has to come
# Files that may sleep, each with its reason.
EXCEPTIONS = {
    "bridges/test_bad_endpoints.py": "a receiver that answers byte by byte",
    "bridges/test_webhooks.py": "receivers that are slow to answer",
    "robustness/bridges/ingest_torture.py": "faults come at moments of chance",
    "robustness/bridges/mqtt_torture.py": "publishes now and then",
    "robustness/bridges/alarm_torture.py": "faults come at moments of chance",
    "robustness/bridges/relay_torture.py": "faults come at moments of chance",
    "robustness/fences/kill_torture.py": "looks again and again whether others have failed",
    "robustness/server/actors.py": "looks again and again whether to go on",
    "robustness/server/torture.py": "looks again and again whether others have failed",
    "server/callers/left.py": "gRPC says nowhere that it has heard of a departure",
    "simulation/link_life.py": "the time is simulated",
    "simulation/link_owners.py": "the time is simulated",
    "simulation/machine.py": "the time is simulated",
    "simulation/network.py": "the time is simulated",
    "simulation/shell_life.py": "the time is simulated",
    "support/faulty_storage.py": "a commit hangs in a process that knows nothing of the tests",
    "support/pacing.py": "pauses that are input, such as those between faults",
    "support/patience.py": "looks again and again for what has to come",
}


def sleeps(source: str) -> Iterator[int]:
    """The lines that let some time pass, and not only others go on, as sleep(0) does."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            gives_way = [each.value for each in node.args if isinstance(each, ast.Constant)] == [0]
            if (
                called in {"Timer", "wait_for_timeout"}
                or (called == "sleep" and not gives_way)
                or (called in {"wait", "join"} and is_short(node))
            ):
                yield node.lineno


def is_short(wait: ast.Call) -> bool:
    """Whether a wait for an event, a thread or tasks ends soon, whatever happens; or is for nothing at all."""
    if not isinstance(wait.func, ast.Attribute):
        return any(each.arg == "timeout" and is_little(each.value) for each in wait.keywords)
    given = [*wait.args, *(each.value for each in wait.keywords if each.arg == "timeout")]
    nobody_sets_it = isinstance(wait.func.value, ast.Call) and bool(given)
    return nobody_sets_it or any(map(is_little, given))


def is_little(value: ast.expr) -> bool:
    """Whether it is a small number of seconds."""
    return isinstance(value, ast.Constant) and isinstance(value.value, int | float) and 0 < value.value < SHORT


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
    short = "e.wait(0.1)", "e.wait(timeout=1)", "asyncio.wait(x, timeout=0.1)", "t.join(0.3)", "Event().wait(x)"
    waits = "time.sleep(0.1)", "sleep(x)", "await asyncio.sleep(1)", "threading.Timer(1, f)", "p.wait_for_timeout(9)"
    goes_on = "time.sleep(0)", "await asyncio.sleep(0)", "sleeps(1)", "time.sleep"
    patient = "e.wait()", "e.wait(PATIENCE)", "e.wait(60)", "asyncio.wait(x, timeout=0)", "t.join()", "', '.join(x)"
    assert [[*sleeps(each)] for each in (*waits, *short)] == [[1]] * len(waits + short)
    assert [[*sleeps(each)] for each in (*goes_on, *patient)] == [[]] * len(goes_on + patient)
