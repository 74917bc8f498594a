"""The page about Slack: its commands and its program, run as a reader would run them."""

import json
import re
import shlex
import subprocess
import sys
import urllib.error
import urllib.request
from collections.abc import Callable
from itertools import takewhile
from pathlib import Path

import pytest
from command_line import dynhull
from forked import COMMAND, Process
from patience import PATIENCE, wait_until
from ports import free_port
from server_process import server_process

from dynhull_bridges.bodies.template import JSON_TYPE, Template
from dynhull_bridges.letters import letter
from dynhull_client import AlarmEvent

PAGE = "how-to/slack"
RELAY = "dynhull relay alarm:slack/spread --consumer slack "
EVENTS = [
    (AlarmEvent("cleared", 1, "a", "u", hull="h"), ":white_check_mark: *a* is cleared for h: it is deleted"),
    (AlarmEvent("snapshot", 1, "a", "u"), "Restored from a backup. *a* is raised for no hull"),
    (AlarmEvent("snapshot", 1, "a", "u", raised=("h", "i")), "Restored from a backup. *a* is raised for h, i"),
    (
        AlarmEvent("lost", 5, "a", "u", first=2, last=5),
        ":warning: events 2 to 5 of *a* were dropped before they could be sent",
    ),
    (AlarmEvent("closed", 6, "a", "u"), "*a* is deleted"),
]


def answer(port: str, body: bytes) -> tuple[int, str]:
    """What the program says to a body."""
    try:
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/", body) as response:
            return response.status, response.read().decode()
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.read().decode()


@pytest.mark.long
def test_slack_from_an_empty_folder(
    take_program: Callable[[str, str], Path],
    take_text: Callable[[str], str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    program, template = take_program(PAGE, "slack.py"), take_program(PAGE, "slack.json")
    text = take_text(PAGE)
    lines = text.splitlines()
    before = [line for line in lines if re.match(r"dynhull (create|put|alarms create) ", line)]
    commands, moves = before[:-2], before[-2:]
    relay = next(line for line in lines if line.startswith(RELAY))
    shown = [*takewhile(str.strip, text[text.index(":red_circle: *slack/") :].splitlines())][:2]
    port = str(free_port())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PORT", port)
    with server_process() as server:
        monkeypatch.setenv("DYNHULL_ADDRESS", server.address)
        for line in commands:
            done = dynhull(*shlex.split(line)[1:])
            assert done.exit_code == 0, done.stderr
        with (
            subprocess.Popen([sys.executable, program], stdout=subprocess.PIPE, text=True) as slack,
            Process([COMMAND, *shlex.split(relay.replace("8000", port))[1:], "--first-pause", "10ms"]) as running,
        ):
            try:
                for move, words in zip(moves, shown, strict=True):
                    assert dynhull(*shlex.split(move)[1:]).exit_code == 0
                    assert slack.stdout.readline() == f"{words}\n"
                wait_until(lambda: "acknowledged 2, 0 events" in dynhull("alarms", "show", "slack/spread").stdout)
                assert answer(port, b"{") == (400, "invalid_payload")
                assert answer(port, b"[]") == (400, "invalid_payload")
                assert answer(port, b"{}") == (400, "no_text")
                for event, words in EVENTS:
                    body = Template(template.read_text(), "page", JSON_TYPE, ["alarm"]).text(letter(event))
                    assert json.loads(body) == {"text": words}
                    assert answer(port, body.encode()) == (200, "ok")
            finally:
                running.terminate()
                slack.terminate()
            assert running.wait(PATIENCE) == 0
