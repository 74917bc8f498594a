"""A read that waits for a revision ends with its caller, at the server, too."""

import json
import signal
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


# A read by parameters that are written otherwise, and a write of keys that are named as they are.
QUOTED = f"/hulls/names?min%5Frevision={LATER}"
NAMED = {"keys": ["min_revision", "keys_min_revision"], "points": [[1, 1], [2, 2]]}


REQUESTS = "dynhull_gateway_requests_total"


def counted(address: str, metric: str, label: str) -> float:
    """The sum of a metric where it has a label."""
    return sum(each for name, each in scrape(address).items() if name.startswith(metric) and label in name)


def ask(gateway: Gateway, method: str, path: str, body: object, headers: str = "") -> socket.socket:
    place = urlsplit(gateway.url)
    assert place.hostname is not None
    sent = b"" if body is None else json.dumps(body).encode()
    head = f"{method} {path} HTTP/1.1\r\nHost: {place.netloc}\r\nContent-Type: application/json\r\n{headers}"
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
            return counted(metrics, "dynhull_calls_total", "CANCELLED")

        with ExitStack() as stack:
            for read in READS:
                stack.enter_context(closing(ask(gateway, *read)))
            for _ in range(2):
                assert gateway.get("/hulls/waits").status == 200
            assert ended() == 0
        wait_until(lambda: ended() == len(READS))
        assert counted(f"127.0.0.1:{port}", REQUESTS, 'status="0"') == len(READS)


def test_a_write_is_made_whatever_its_keys_are_called() -> None:
    """Writes go on without their callers; those with such keys ended as reads do, and some of them were lost."""
    port = free_port()
    with (
        measured() as (server, _),
        gateway_process(server.address, "--metrics-port", str(port)) as gateway,
        HullClient(server.address) as client,
    ):
        client.create_hull("names", keyed="str")
        assert gateway.get("/hulls/names").status == 200

        def answered(status: int) -> float:
            return counted(f"127.0.0.1:{port}", REQUESTS, f'status="{status}"')

        before = answered(200)
        server.process.send_signal(signal.SIGSTOP)
        try:
            written = ask(gateway, "POST", "/hulls/names/points", NAMED, "Idempotency-Key: writer:1\r\n")
            asked = ask(gateway, "GET", QUOTED, None)
            written.close()
            asked.close()
            wait_until(lambda: answered(0) == 1)  # the read, whose caller went last
        finally:
            server.process.send_signal(signal.SIGCONT)
        wait_until(lambda: answered(200) == before + 1)
        assert client.get_hull("names").vertices.tolist() == NAMED["points"]
        assert answered(0) == 1


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
