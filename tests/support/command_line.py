"""Commands of `dynhull` as users run them."""

import os
import pty
from typing import Any

from forked import COMMAND, Process
from patience import PATIENCE
from typer.testing import CliRunner, Result

from dynhull_cli.commands import app


def dynhull(*arguments: object, input: str | bytes | None = None, **more: Any) -> Result:  # noqa: A002
    """Run a command to its end: in this process, because another one takes half a second to start.

    `more`: further arguments of the runner, such as the environment.
    """
    return CliRunner().invoke(app, [str(each) for each in arguments], input=input, **more)


def on_a_terminal(*arguments: str, answer: bytes = b"") -> tuple[int, str]:
    """Run a command on a terminal of its own; returns its exit code and what it showed."""
    controller, terminal = pty.openpty()
    with Process([COMMAND, *arguments], stdin=terminal, stdout=terminal, stderr=terminal) as command:
        os.close(terminal)
        os.write(controller, answer)
        code = command.wait(PATIENCE)
        shown = b""
        while True:
            try:
                part = os.read(controller, 65536)
            except OSError:  # the other end is closed, and everything has been read
                break
            shown += part
    os.close(controller)
    return code, shown.decode()
