"""Lines of the server's log."""

import json
import logging
import re
from collections.abc import Iterator

import pytest

from dynhull_server import logs

TIME = r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z"
log = logging.getLogger("dynhull_server.test")


@pytest.fixture(autouse=True)
def root() -> Iterator[None]:
    """The root logger as it was, after a test that has configured it."""
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    root.handlers.clear()  # those of others would be closed
    yield
    root.handlers[:] = handlers
    root.setLevel(level)


def fail(secret: str) -> None:
    """Fail with a local variable."""
    raise ValueError(f"{len(secret)} letters")


def test_a_line_of_text_has_the_fields_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure("info", "text", "worker 1")
    log.info("took %d ms", 5, extra={"hull": "fleet/1", "why": 'said "no"', "empty": "", "pause": 0.25})
    log.debug("not wanted")
    (line,) = capsys.readouterr().err.splitlines()
    said = r"\[info     \] took 5 ms {22}\[dynhull_server\.test\]"
    fields = r"empty= hull=fleet/1 pause=0\.25 process='worker 1' why='said \"no\"'"
    assert re.fullmatch(f"{TIME} {said} {fields}", line)


def test_a_line_of_json_is_an_object(capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure("warning", "json")
    log.warning("lost", extra={"what": {1, 2}, "rows": [1, None]})
    found = json.loads(capsys.readouterr().err)
    assert re.fullmatch(TIME, found.pop("timestamp"))
    expected = {"event": "lost", "level": "warning", "logger": "dynhull_server.test", "what": "{1, 2}"}
    assert found == expected | {"rows": [1, None]}


@pytest.mark.parametrize("form", ["text", "json"])
def test_a_failure_is_told_without_the_values_of_variables(form: str, capsys: pytest.CaptureFixture[str]) -> None:
    logs.configure("info", form)
    secret = f"{48.25}"  # not as it is in the lines of this file, which a traceback shows
    try:
        fail(secret)
    except ValueError:
        log.exception("failed", stack_info=True)
    said = capsys.readouterr().err
    trace = json.loads(said)["exception"] if form == "json" else said
    assert "ValueError: 5 letters" in trace.splitlines()
    assert "in fail" in trace
    assert "stack_info" in said
    assert secret not in said
