"""Logging to standard error, as text or JSON."""

import logging
import sys
from typing import Any

import structlog


def configure(level: str, form: str, process: str = "") -> None:
    """Log from `level` on, as "text" or "json". Each key of `extra` becomes a field of the line.

    Args:
        level: the least level to log.
        form: the format.
        process: the name of the process, a field of every line; empty where there is only one.
    """

    def name_process(_: Any, __: str, event: structlog.typing.EventDict) -> structlog.typing.EventDict:
        return {**event, "process": process} if process else event

    render: Any
    if form == "json":
        render = [structlog.processors.format_exc_info, structlog.processors.JSONRenderer()]
    else:
        # The default would show local variables, and so the points of users.
        plain = structlog.dev.plain_traceback
        render = [structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty(), exception_formatter=plain)]
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(
        structlog.stdlib.ProcessorFormatter(
            foreign_pre_chain=[
                structlog.stdlib.add_log_level,
                structlog.stdlib.add_logger_name,
                structlog.stdlib.ExtraAdder(),
                name_process,
                structlog.processors.TimeStamper(fmt="iso", utc=True),
            ],
            processors=[structlog.stdlib.ProcessorFormatter.remove_processors_meta, *render],
        )
    )
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)
