"""Callers that leave while they are answered are no news for the server's operator."""

import sys
from pathlib import Path

from server_process import finished


def test_a_caller_that_leaves_while_it_is_answered_is_no_error_of_the_server() -> None:
    ended = finished([sys.executable, str(Path(__file__).with_name("left.py"))])
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "the answer failed\n", "")
