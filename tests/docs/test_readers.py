"""The page about many readers: its programs, run as a reader would run them."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import PIPE

from forked import Process
from patience import PATIENCE
from server_process import server_process


def test_a_reader_from_an_empty_folder(take_program: Callable[[str, str], Path]) -> None:
    programs = [take_program("how-to/readers", name) for name in ("writer.py", "reader.py")]
    with server_process("--log-level", "error") as server:
        writer, reader = ([sys.executable, program, server.address] for program in programs)
        with Process(writer, stderr=subprocess.DEVNULL) as writing:
            try:
                with (
                    Process(reader, stdout=PIPE, stderr=PIPE, text=True) as first,
                    Process(reader, stdout=PIPE, stderr=PIPE, text=True) as second,
                ):
                    said, complaints = first.communicate(timeout=PATIENCE)
                    lines = said.splitlines()
                    assert "of 100000 points are in the hull" in lines[0]
                    assert lines[1].startswith("distance of (9, 9): ")
                    assert not complaints
                    assert second.communicate(timeout=PATIENCE)[0].splitlines()[1].startswith("distance")
                with Process(reader, stdout=PIPE, stderr=PIPE, text=True) as left:
                    assert "points are in the hull" in left.stdout.readline()
                    server.process.terminate()
                    said, complaints = left.communicate(timeout=PATIENCE)
                    assert "more than its max_staleness of 3 s" in said
                    assert not complaints
            finally:
                writing.terminate()
