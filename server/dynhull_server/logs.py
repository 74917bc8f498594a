"""Logging to standard error, as text or JSON."""

import logging
import sys
from typing import Any

import grpc
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
    handler.addFilter(_concerns_the_server)
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)


def caller_has_left(error: BaseException | None) -> bool:
    """Whether gRPC could not send or receive since the call has ended, which it may notice before its cancellation."""
    return isinstance(error, grpc.aio.InternalError) and str(error).startswith('Failed "execute_batch"')


def _concerns_the_server(record: logging.LogRecord) -> bool:
    """Callers may leave at any time, also while gRPC answers them, which it logs as an error."""
    return not (record.exc_info and caller_has_left(record.exc_info[1]))
