"""Logging to standard error, as text or JSON."""

import json
import logging
import re
import sys
from datetime import UTC, datetime
from typing import Any

import grpc

# What every record has: the rest came with `extra`.
OWN = {*vars(logging.makeLogRecord({})), "message", "asctime"}
WORD = re.compile(r"[^\s=\"']*")


def configure(level: str, form: str, process: str = "") -> None:
    """Log from `level` on, as "text" or "json". Each key of `extra` becomes a field of the line.

    Args:
        level: the least level to log.
        form: the format.
        process: the name of the process, a field of every line; empty where there is only one.
    """
    handler = logging.StreamHandler(sys.stderr)
    lines = _Json if form == "json" else _Text
    handler.setFormatter(lines({"process": process} if process else {}))
    handler.addFilter(_concerns_the_server)
    logging.basicConfig(level=level.upper(), handlers=[handler], force=True)


def caller_has_left(error: BaseException | None) -> bool:
    """Whether gRPC could not send or receive since the call has ended, which it may notice before its cancellation."""
    return isinstance(error, grpc.aio.InternalError) and str(error).startswith('Failed "execute_batch"')


def _concerns_the_server(record: logging.LogRecord) -> bool:
    """Callers may leave at any time, also while gRPC answers them, which it logs as an error."""
    return not (record.exc_info and caller_has_left(record.exc_info[1]))


class _Lines(logging.Formatter):
    """A line for each record. `more` are fields of every line."""

    def __init__(self, more: dict[str, Any]) -> None:
        super().__init__()
        self._more = more

    def format(self, record: logging.LogRecord) -> str:
        """The line."""
        fields = {name: value for name, value in vars(record).items() if name not in OWN} | self._more
        if record.stack_info:
            fields["stack_info"] = record.stack_info
        # Python's traceback shows no local variables, which may be points of users.
        trace = self.formatException(record.exc_info) if record.exc_info else ""
        time = datetime.fromtimestamp(record.created, UTC).isoformat(timespec="microseconds").replace("+00:00", "Z")
        return self._line(time, record, fields, trace)

    def _line(self, time: str, record: logging.LogRecord, fields: dict[str, Any], trace: str) -> str:
        raise NotImplementedError


class _Text(_Lines):
    """For people: what has happened, then the fields by their names; a traceback in lines of its own."""

    def _line(self, time: str, record: logging.LogRecord, fields: dict[str, Any], trace: str) -> str:
        begin = f"{time} [{record.levelname.lower():9}] {record.getMessage():30} [{record.name}]"
        named = (f"{name}={_shown(fields[name])}" for name in sorted(fields))
        return "\n".join([" ".join([begin, *named]), *([trace] if trace else [])])


class _Json(_Lines):
    """For machines: an object."""

    def _line(self, time: str, record: logging.LogRecord, fields: dict[str, Any], trace: str) -> str:
        said = {"event": record.getMessage(), "level": record.levelname.lower(), "logger": record.name}
        exception = {"exception": trace} if trace else {}
        return json.dumps(said | fields | {"timestamp": time} | exception, default=repr)


def _shown(value: object) -> str:
    """A value as it is if that is one word, otherwise as Python writes it."""
    return value if isinstance(value, str) and WORD.fullmatch(value) else repr(value)
