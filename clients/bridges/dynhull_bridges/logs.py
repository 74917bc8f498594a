"""Logging to standard error, as text or JSON."""

import logging
import sys
from typing import Any

import structlog


def configure(form: str) -> None:
    """Log as "text" or "json"."""
    render: Any = structlog.processors.JSONRenderer()
    if form == "text":
        plain = structlog.dev.plain_traceback
        render = structlog.dev.ConsoleRenderer(colors=sys.stderr.isatty(), exception_formatter=plain)
    structlog.configure(
        processors=[structlog.processors.add_log_level, structlog.processors.TimeStamper(fmt="iso", utc=True), render],
        logger_factory=structlog.PrintLoggerFactory(sys.stderr),
    )
    # Relay and ingest report lost connections themselves, once each.
    for client in ("nats", "mqtt", "aiokafka"):
        logging.getLogger(client).setLevel(logging.CRITICAL)
