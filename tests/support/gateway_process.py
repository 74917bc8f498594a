"""A real gateway in a process of its own, and plain HTTP calls to it."""

import http.client
import json
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from urllib.parse import urlsplit

from forked import COMMAND, Process
from patience import PATIENCE

NDJSON, CSV, GEOJSON = "application/x-ndjson", "text/csv", "application/geo+json"


@dataclass(frozen=True)
class Answer:
    status: int
    headers: Mapping[str, str]
    body: bytes

    @property
    def json(self) -> Any:
        return json.loads(self.body)


class Gateway:
    """A gateway at `url`."""

    def __init__(self, url: str, process: subprocess.Popen[str] | None = None) -> None:
        self.url = url
        self.process = process
        self.place = urlsplit(url).netloc

    def connection(self) -> http.client.HTTPConnection:
        return http.client.HTTPConnection(self.place, timeout=PATIENCE)

    def call(self, method: str, path: str, body: Any = None, kind: str | None = None, **headers: str) -> Answer:
        """One request; a body that is neither bytes nor an iterator of them is sent as JSON."""
        if body is not None and not isinstance(body, bytes | Iterator):
            body, kind = json.dumps(body).encode(), kind or "application/json"
        if kind is not None:
            headers = {"Content-Type": kind, **headers}
        connection = self.connection()
        try:
            named = {name.replace("_", "-"): value for name, value in headers.items()}
            connection.request(method, urlsplit(self.url).path + path, body, named)
            response = connection.getresponse()
            return Answer(response.status, response.headers, response.read())
        finally:
            connection.close()

    def get(self, path: str, **headers: str) -> Answer:
        return self.call("GET", path, **headers)

    def post(self, path: str, body: Any, kind: str | None = None, **headers: str) -> Answer:
        return self.call("POST", path, body, kind, **headers)


@contextmanager
def gateway_process(address: str, *options: str, complaints: str = "", killed: bool = False) -> Iterator[Gateway]:
    """`dynhull gateway` on a free port, unless the options name one.

    It must exit with code 0, unless it was `killed`, and log nothing else.
    """
    command = [COMMAND, "gateway", "--port", "0", "--address", address, *options]
    with (
        tempfile.TemporaryFile("w+") as errors,
        Process(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        try:
            first_line = process.stdout.readline()
            assert first_line.startswith("dynhull gateway on http://"), errors.seek(0) or errors.read()
            yield Gateway(first_line.split()[-1], process)
        finally:
            process.terminate()
            ended = process.wait(PATIENCE)
            errors.seek(0)
            said = errors.read()
            assert ended == (-signal.SIGKILL if killed else 0), said
            assert complaints in said if complaints else not said, said
            assert "Traceback" not in said, said


class Events:
    """The events of a stream, read without a browser."""

    def __init__(self, gateway: Gateway, path: str, body: Any = None, **headers: str) -> None:
        self._connection = gateway.connection()
        given = {name.replace("_", "-"): each for name, each in headers.items()}
        if body is None:
            self._connection.request("GET", urlsplit(gateway.url).path + path, headers=given)
        else:
            given["Content-Type"] = "application/json"
            self._connection.request("POST", urlsplit(gateway.url).path + path, json.dumps(body), given)
        self.response = self._connection.getresponse()

    def __iter__(self) -> Iterator[dict[str, str]]:
        event: dict[str, str] = {}
        while line := self.response.readline().decode():
            name, _, value = line.rstrip("\n").partition(": ")
            if name:
                event[name] = value
            else:
                if {"event", "id"} & event.keys():
                    yield event
                event = {}

    def next(self) -> tuple[str, Any]:
        """The name and the data of the next event; those of an id alone are the id and None."""
        event = next(iter(self))
        return event.get("event", event.get("id")), json.loads(event["data"]) if "data" in event else None

    def close(self) -> None:
        self.response.close()
        self._connection.close()
