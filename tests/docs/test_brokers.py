"""The page about brokers: its commands and its program, run as a reader would run them."""

import shlex
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from brokers import broker, nats_server
from command_line import dynhull
from ports import free_port
from server_process import server_process

INGEST = (
    "dynhull ingest 'nats://127.0.0.1:4222/POSITIONS/fleet.*.position' --hull brokers/fleet --key '{1}' "
    "--time '$.ts' --to-end"
)
QUERY = "dynhull query brokers/fleet vertices --keys"


def test_positions_from_an_empty_folder(
    take_program: Callable[[str, str], Path],
    take_text: Callable[[str], str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    program = take_program("how-to/brokers", "vehicles.py")
    text = take_text("how-to/brokers")
    for line in (INGEST, QUERY):
        assert line in text
    port = free_port()
    monkeypatch.setenv("NATS_URL", f"nats://127.0.0.1:{port}")
    with server_process() as server, broker(nats_server(tmp_path, port), port):
        monkeypatch.setenv("DYNHULL_ADDRESS", server.address)
        subprocess.run([sys.executable, program], check=True)
        ingest = dynhull(*shlex.split(INGEST.replace("4222", str(port)))[1:])
        assert ingest.exit_code == 0, ingest.stderr
        assert "points=300" in ingest.stderr
        corners = dynhull(*shlex.split(QUERY)[1:]).stdout
        subprocess.run([sys.executable, take_program("how-to/alarms", "stream.py")], check=True)
    assert corners.count("\n") == 3
    shown = " ".join(text.split())
    assert all(" ".join(line.split()) in shown for line in corners.splitlines()), "the page shows them"
