"""The page about alarms: its commands and its program, run as a reader would run them."""

import base64
import os
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import dynhull
from forked import COMMAND, Process
from patience import PATIENCE, wait_until
from ports import free_port
from server_process import server_process

BEFORE = """\
dynhull create alarms/vehicles --keyed str --geographic
dynhull put alarms/vehicles truck-7 13.4 52.5
dynhull fences create alarms/depot --polygon 'POLYGON ((13 52, 14 52, 14 53, 13 53, 13 52))' --subjects alarms/vehicles
dynhull put alarms/vehicles truck-7 11.6 48.1
dynhull fences watch alarms/depot --after 0 --events 2"""
RELAY = "dynhull relay alarms/depot --consumer alarm --to http://127.0.0.1:8000/ --allow-private"
AFTER = "dynhull put alarms/vehicles truck-7 13.4 52.5"
LIST = "dynhull relay dead-letters list"


def run(command: str) -> list[str]:
    done = dynhull(*shlex.split(command)[1:])
    assert done.exit_code == 0, done.stderr
    return done.stdout.splitlines()


@pytest.mark.long
def test_an_alarm_from_an_empty_folder(
    take_program: Callable[[str, str], Path],
    take_text: Callable[[str], str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    program = take_program("how-to/alarms", "alarm.py")
    text = take_text("how-to/alarms")
    for line in [*BEFORE.splitlines(), RELAY, AFTER, LIST]:
        assert line in text
    port = str(free_port())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DYNHULL_WEBHOOK_SECRET", f"whsec_{base64.b64encode(os.urandom(32)).decode()}")
    monkeypatch.setenv("PORT", port)
    with server_process() as server:
        monkeypatch.setenv("DYNHULL_ADDRESS", server.address)
        printed = [run(line) for line in BEFORE.splitlines()][-1]
        assert [line.split("\t")[2] for line in printed] == ["snapshot", "exit"]
        relay = [COMMAND, *shlex.split(RELAY.replace("8000", port))[1:]]
        with (
            subprocess.Popen([sys.executable, program], stdout=subprocess.PIPE, text=True) as alarm,
            Process([*relay, "--first-pause", "10ms"], stderr=subprocess.DEVNULL) as running,
        ):
            try:
                heard = [alarm.stdout.readline().split()[1:] for _ in range(2)]
                assert heard == [["dynhull.fence.snapshot"], ["dynhull.fence.exit", "truck-7"]]
                run(AFTER)
                assert alarm.stdout.readline().split()[1:] == ["dynhull.fence.enter", "truck-7"]
                wait_until(
                    lambda: (
                        "consumer\talarm: acknowledged 3, 0 events to come" in run("dynhull fences show alarms/depot")
                    )
                )
            finally:
                running.terminate()
                alarm.terminate()
            assert running.wait(PATIENCE) == 0
    assert run(LIST) == []
