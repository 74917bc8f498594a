"""Endpoints that hang, trickle, break off, redirect or have no address: nothing is lost, and ids stay the same."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import pytest
from patience import PATIENCE, wait_until
from receiver import Received, Receiver, receiver
from relay_process import FAST, acknowledged, fence, pass_through, relay_process

from dynhull_client import HullClient

PLAIN = ("--unsigned", "--allow-private", *FAST)
SHORT = ("--timeout", "300ms")
KEYS = [f"truck-{i}" for i in range(3)]
LAST = 2 * len(KEYS)
Behaviour = Callable[[socket.socket, threading.Event], None]


@pytest.fixture
def client(address: str, name: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        fence(client, name)
        yield client


def request_of(connection: socket.socket) -> bytes:
    """The whole request, which has a Content-Length."""
    found = b""
    while b"\r\n\r\n" not in found:
        found += connection.recv(65536)
    head, _, body = found.partition(b"\r\n\r\n")
    length = next(
        int(line.split(b":")[1]) for line in head.lower().split(b"\r\n") if line.startswith(b"content-length")
    )
    while len(body) < length:
        body += connection.recv(65536)
    return body


def hangs(connection: socket.socket, over: threading.Event) -> None:
    request_of(connection)
    over.wait()


def never_reads(_: socket.socket, over: threading.Event) -> None:
    over.wait()


def trickles(connection: socket.socket, over: threading.Event) -> None:
    request_of(connection)
    for byte in b"HTTP/1.1 200 OK\r\nContent-Length: 0\r\n":
        if over.wait(0.05):
            return
        connection.sendall(bytes([byte]))


def breaks_off_in_the_status(connection: socket.socket, _: threading.Event) -> None:
    request_of(connection)
    connection.sendall(b"HTTP/1.1 20")


def breaks_off_in_the_headers(connection: socket.socket, _: threading.Event) -> None:
    request_of(connection)
    connection.sendall(b"HTTP/1.1 200 OK\r\nContent-Le")


def answers_before_it_has_read(connection: socket.socket, _: threading.Event) -> None:
    connection.recv(10)
    connection.sendall(b"HTTP/1.1 503 Busy\r\nContent-Length: 0\r\n\r\n")


def speaks_something_else(connection: socket.socket, _: threading.Event) -> None:
    request_of(connection)
    connection.sendall(b"220 mail.example ESMTP\r\n")


def answers_with_an_endless_header(connection: socket.socket, _: threading.Event) -> None:
    request_of(connection)
    connection.sendall(b"HTTP/1.1 200 OK\r\nX: " + b"x" * 100_000)


def resets(connection: socket.socket, _: threading.Event) -> None:
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")


def redirects_in_circles(connection: socket.socket, _: threading.Event) -> None:
    request_of(connection)
    port = connection.getsockname()[1]
    connection.sendall(f"HTTP/1.1 307 Away\r\nLocation: http://127.0.0.1:{port}/\r\nContent-Length: 0\r\n\r\n".encode())


def refuses_and_stalls(connection: socket.socket, over: threading.Event) -> None:
    request_of(connection)
    connection.sendall(b"HTTP/1.1 400 No\r\nContent-Length: 9\r\n\r\n")
    over.wait()


def refuses_in_a_broken_encoding(connection: socket.socket, _: threading.Event) -> None:
    request_of(connection)
    connection.sendall(b"HTTP/1.1 400 No\r\nContent-Encoding: gzip\r\nContent-Length: 3\r\n\r\nabc")


BAD = [
    hangs,
    never_reads,
    trickles,
    breaks_off_in_the_status,
    breaks_off_in_the_headers,
    answers_before_it_has_read,
    speaks_something_else,
    answers_with_an_endless_header,
    resets,
    redirects_in_circles,
]


@contextmanager
def bad_then(behaviours: list[Behaviour], good: Receiver) -> Iterator[str]:
    """The URL of an endpoint that behaves badly once in each way, and passes later connections on to a good one."""
    over, left = threading.Event(), iter(behaviours)
    listening = socket.create_server(("127.0.0.1", 0))
    target = good.url.split("/")[2].split(":")

    def serve(connection: socket.socket) -> None:
        with connection:
            try:
                if (behaviour := next(left, None)) is not None:
                    behaviour(connection, over)
                    return
                body = request_of(connection)
                with socket.create_connection((target[0], int(target[1]))) as onward:
                    head = f"POST /hook HTTP/1.1\r\nHost: a\r\nContent-Length: {len(body)}\r\n\r\n"
                    onward.sendall(head.encode() + body)
                    while answer := onward.recv(65536):
                        connection.sendall(answer)
            except OSError:  # the relay has given up
                return

    def accept() -> None:
        while True:
            try:
                connection, _ = listening.accept()
            except OSError:
                return
            threading.Thread(target=serve, args=(connection,), daemon=True).start()

    accepting = threading.Thread(target=accept)
    accepting.start()
    try:
        yield f"http://127.0.0.1:{listening.getsockname()[1]}/"
    finally:
        over.set()
        listening.shutdown(socket.SHUT_RDWR)
        listening.close()
        accepting.join()


def arrived_in_order(endpoint: Receiver, name: str) -> None:
    """Every event has arrived, none before its predecessor, and each with one id."""
    found = endpoint.events(name)
    sequences = [event["data"]["sequence"] for event in found]
    assert sorted(set(sequences)) == list(range(1, LAST + 1))
    assert all(after <= before + 1 for before, after in pairwise(sequences))
    assert len({(event["id"], event["data"]["sequence"]) for event in found}) == LAST


def test_bad_endpoints_lose_nothing(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    pass_through(client, name, KEYS)
    with receiver() as endpoint, bad_then(BAD, endpoint) as url:
        with relay_process(address, tmp_path, name, "--to", url, *PLAIN, *SHORT) as relay:
            wait_until(lambda: acknowledged(client, name) == LAST)
            failures = relay.said("not delivered, trying again")
        assert len(failures) == len(BAD)
        assert {line["id"] for line in failures} == {f"{client.get_fence(name).uid}-1"}
        arrived_in_order(endpoint, name)


def test_a_refusal_counts_whatever_its_text_is(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    """Otherwise an event would be tried for ever, and hold up those after it, for want of an explanation."""
    pass_through(client, name, KEYS)
    refusals = [refuses_and_stalls, refuses_in_a_broken_encoding]
    with receiver() as endpoint, bad_then(refusals, endpoint) as url:
        with relay_process(address, tmp_path, name, "--to", url, *PLAIN, *SHORT, "--attempts", "2") as relay:
            wait_until(lambda: acknowledged(client, name) == LAST)
            (dead,) = relay.said("refused: a dead letter now")
        assert dead["error"] == "HTTP 400 No ''"
        assert {event["data"]["sequence"] for event in endpoint.events(name)} == set(range(2, LAST + 1))


def test_a_name_without_an_address_is_tried_again(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    pass_through(client, name, KEYS)
    with relay_process(address, tmp_path, name, "--to", "http://nowhere.invalid/", "--unsigned", *FAST) as relay:
        wait_until(lambda: len(relay.said("not delivered, trying again")) >= 2)
        failures = relay.said("not delivered, trying again")
        assert {line["id"] for line in failures} == {f"{client.get_fence(name).uid}-1"}
        assert "nowhere.invalid" in failures[0]["error"]
    assert acknowledged(client, name) == 0


def test_a_relay_that_is_killed_repeats_with_the_same_ids(
    client: HullClient, address: str, name: str, tmp_path: Path
) -> None:
    """Killed while the second event is not answered, in a pause after the third, and when the fourth is answered."""
    pass_through(client, name, KEYS)
    held: dict[int, threading.Event] = {sequence: threading.Event() for sequence in (2, 3, 5)}
    killed: dict[int, threading.Event] = {sequence: threading.Event() for sequence in held}

    def answer(request: Received) -> tuple[int, dict[str, str]]:
        sequence = request.events[0]["data"]["sequence"]
        if sequence in held and not killed[sequence].is_set():
            held[sequence].set()
            if sequence == 3:
                return 503, {"Retry-After": "3600"}
            killed[sequence].wait()
        return 200, {}

    with receiver() as endpoint:
        endpoint.answer = answer
        for sequence in held:
            with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN, killed=True) as relay:
                held[sequence].wait(PATIENCE)
                relay.process.kill()
                relay.process.wait()
            killed[sequence].set()
            assert acknowledged(client, name) < sequence
        with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN):
            wait_until(lambda: acknowledged(client, name) == LAST)
        arrived_in_order(endpoint, name)
        repeated = [request.headers["webhook-id"] for request in endpoint.received]
        assert len(repeated) >= LAST + len(held)
        assert len(set(repeated)) == LAST
