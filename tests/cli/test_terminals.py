"""Commands that go on, as they look on a terminal."""

import os
import pty

from forked import COMMAND, Process
from mortal_server import MortalServer


def test_top_says_that_its_numbers_are_old(tmp_path):
    server = MortalServer(tmp_path)
    controller, terminal = pty.openpty()
    command = [COMMAND, "top", "--interval", "0.05", "--address", server.address]
    with Process(command, stdin=terminal, stdout=terminal, stderr=terminal) as top:
        os.close(terminal)
        shown = b""
        while b"revision" not in shown:
            shown += os.read(controller, 65536)
        server.kill()
        while b"connection lost" not in shown:
            shown += os.read(controller, 65536)
        top.kill()
    os.close(controller)
