"""The page about an operations room: its program and its commands, run as a reader would run them."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import dynhull
from patience import wait_until
from server_process import server_process

from dynhull_client import HullClient

PAGE = "how-to/operations-room"


@pytest.mark.long
def test_the_alarm_of_the_page_is_raised(
    take_program: Callable[[str, str], Path],
    take_text: Callable[[str], str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    program, lines = take_program(PAGE, "drive.py"), take_text(PAGE).splitlines()
    commands = [line for line in lines if re.match(r"dynhull alarms create ", line)]
    assert len(commands) == 2
    with server_process("--data", str(tmp_path)) as server, HullClient(server.address) as client:
        monkeypatch.setenv("DYNHULL_ADDRESS", server.address)
        subprocess.run([sys.executable, program], check=True, env={**os.environ, "SECONDS": "0"})
        names = [hull.name for hull in client.list_hulls("room/")]
        assert names == ["room/berlin", "room/hamburg", "room/munich"]
        for line in commands:
            done = dynhull(*shlex.split(line)[1:])
            assert done.exit_code == 0, done.stderr
        assert not any(status.raised for status in client.get_alarm("room/spread").statuses)
        # Where the van is half a minute later.
        client.put("room/berlin", ["van-39"], [(13.40 + 0.13 + 0.004 * 30, 52.52)])
        wait_until(lambda: any(status.raised for status in client.get_alarm("room/spread").statuses))
        raised = [status.hull for status in client.get_alarm("room/spread").statuses if status.raised]
        assert raised == ["room/berlin"]
