"""A command of `dynhull` that gets a signal just before it sends a statement to PostgreSQL.

    python tests/support/signalled_command.py KILL 'number or beginning' cluster split ...

The statement is the one of that number, or the first one with that beginning.
"""

import os
import sys
from itertools import count
from signal import Signals
from typing import Any

import psycopg

from dynhull_cli.main import main


def signal_before(statement: str, signal: Signals) -> None:
    """Have the process get the signal before a statement."""
    execute: Any = psycopg.Connection.execute
    numbers = count(1)

    def signalled(self: Any, query: Any, *arguments: Any, **options: Any) -> Any:
        text = query.decode() if isinstance(query, bytes) else str(query)
        if str(next(numbers)) == statement or text.startswith(statement):
            os.kill(os.getpid(), signal)
        return execute(self, query, *arguments, **options)

    psycopg.Connection.execute = signalled  # type: ignore[method-assign]


if __name__ == "__main__":
    name, before = sys.argv.pop(1), sys.argv.pop(1)
    signal_before(before, Signals[f"SIG{name}"])
    main()
