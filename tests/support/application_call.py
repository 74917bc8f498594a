"""Calls to the gateway's application, without a process around it."""

import asyncio
import json
from typing import Any
from urllib.parse import urlsplit

from fastapi import FastAPI


async def called(application: FastAPI, path: str, posted: Any = None, **headers: str) -> tuple[int, str]:
    """The status and the whole body of a GET, or of a POST of JSON; of a stream, one that ends."""
    parts = urlsplit(path)
    status, body = 0, b""
    coming = [] if posted is None else [{"type": "http.request", "body": json.dumps(posted).encode()}]
    kind = {} if posted is None else {"content-type": "application/json", "content-length": str(len(coming[0]["body"]))}

    async def receive() -> dict[str, Any]:
        if coming:
            return coming.pop()
        await asyncio.Event().wait()  # the caller stays
        raise AssertionError

    async def send(message: dict[str, Any]) -> None:
        nonlocal status, body
        status = message.get("status", status)
        body += message.get("body", b"")

    scope = {
        "type": "http",
        "asgi": {"version": "3.0"},
        "http_version": "1.1",
        "method": "GET" if posted is None else "POST",
        "scheme": "http",
        "path": parts.path,
        "raw_path": parts.path.encode(),
        "query_string": parts.query.encode(),
        "root_path": "",
        "headers": [(name.replace("_", "-").encode(), value.encode()) for name, value in (headers | kind).items()],
        "client": ("127.0.0.1", 1),
        "server": ("127.0.0.1", 80),
    }
    await application(scope, receive, send)
    return status, body.decode()
