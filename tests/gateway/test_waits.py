"""A read that waits for a revision ends with its caller, at the server, too."""

import json
import socket
from contextlib import ExitStack, closing
from urllib.parse import urlsplit

from gateway_process import Gateway, gateway_process
from metrics import measured, scrape
from patience import PATIENCE, wait_until
from ports import free_port

from dynhull_client import HullClient

LATER = 10**6
ABOUT = {"points": [[1, 1]]}
BY_KEYS = {"keys": ["a"], "keys_of": "waits", "keys_min_revision": LATER}
READS = [
    ("GET", f"/hulls/waits?min_revision={LATER}", None),
    ("GET", f"/hulls/waits/measures?min_revision={LATER}", None),
    ("GET", f"/hulls/waits/separation?other=waits&other_min_revision={LATER}", None),
    ("POST", f"/hulls/waits/locate?min_revision={LATER}", ABOUT),
    ("POST", "/hulls/waits/distance", BY_KEYS),
]


def ask(gateway: Gateway, method: str, path: str, body: object) -> socket.socket:
    place = urlsplit(gateway.url)
    assert place.hostname is not None
    sent = b"" if body is None else json.dumps(body).encode()
    head = f"{method} {path} HTTP/1.1\r\nHost: {place.netloc}\r\nContent-Type: application/json\r\n"
    connection = socket.create_connection((place.hostname, place.port), PATIENCE)
    connection.sendall(f"{head}Content-Length: {len(sent)}\r\n\r\n".encode() + sent)
    return connection


def test_reads_end_with_their_callers() -> None:
    port = free_port()
    with (
        measured() as (server, metrics),
        gateway_process(server.address, "--metrics-port", str(port)) as gateway,
        HullClient(server.address) as client,
    ):
        client.create_hull("waits", keyed="str")
        client.put("waits", ["a"], [(0, 0)])

        def ended() -> float:
            return sum(
                each
                for name, each in scrape(metrics).items()
                if name.startswith("dynhull_calls_total") and "CANCELLED" in name
            )

        with ExitStack() as stack:
            for read in READS:
                stack.enter_context(closing(ask(gateway, *read)))
            for _ in range(2):
                assert gateway.get("/hulls/waits").status == 200
            assert ended() == 0
        wait_until(lambda: ended() == len(READS))
        figures = scrape(f"127.0.0.1:{port}")
        unanswered = [
            each
            for name, each in figures.items()
            if name.startswith("dynhull_gateway_requests_total") and 'status="0"' in name
        ]
        assert sum(unanswered) == len(READS)


def test_callers_that_stay_are_answered(address: str) -> None:
    with gateway_process(address) as gateway, HullClient(address) as client, ExitStack() as stack:
        client.create_hull("stays", keyed="str")
        waiting = [
            stack.enter_context(
                closing(
                    ask(
                        gateway,
                        method,
                        path.replace("waits", "stays").replace(str(LATER), "2"),
                        body and {**body, **({"keys_of": "stays", "keys_min_revision": 2} if "keys" in body else {})},
                    )
                )
            )
            for method, path, body in READS
        ]
        client.put("stays", ["a"], [(0, 0)])
        client.put("stays", ["b"], [(4, 0)])
        for connection in waiting:
            assert connection.recv(65536).startswith(b"HTTP/1.1 200 ")
