"""Events of fences arrive at a real MQTT broker and in a real stream of NATS, also when these are killed."""

import asyncio
import json
import socketserver
import subprocess
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import nats
import pytest
from brokers import broker, mosquitto, nats_server
from patience import PATIENCE, wait_until
from ports import free_port
from relay_process import FAST, acknowledged, fence, pass_through, relay_process
from server_process import run
from subscriber import Subscriber

from dynhull_client import HullClient

KEYS = ["a", "b", "c"]


@pytest.fixture
def client(address: str, name: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        fence(client, name)
        yield client


@pytest.fixture
def port() -> int:
    return free_port()


def test_mqtt(client: HullClient, address: str, name: str, tmp_path: Path, port: int) -> None:
    """The relay is there before the broker, and before both a subscription, in a session that the broker keeps."""
    command = mosquitto(tmp_path, port, "persistence true", f"persistence_location {tmp_path}/")
    to = ("--to", f"mqtt://127.0.0.1:{port}", "--timeout", "1s", *FAST)
    with saved(broker(command, port)):
        Subscriber(port, "first")
    with relay_process(address, tmp_path, name, *to) as relay:
        pass_through(client, name, KEYS)
        relay.wait_for("not delivered, trying again")
        with saved(broker(command, port)):
            subscriber = Subscriber(port, "first")
            wait_until(lambda: acknowledged(client, name) == 6)
            wait_until(lambda: sequences(subscriber) == list(range(1, 7)))
        pass_through(client, name, KEYS)
        with broker(command, port):
            again = Subscriber(port, "first")
            wait_until(lambda: acknowledged(client, name) == 12)
            wait_until(lambda: sequences(again) == list(range(7, 13)))
    assert {topic for topic, _ in again.messages} == {f"dynhull/{name}/enter", f"dynhull/{name}/exit"}


def sequences(subscriber: Subscriber) -> list[int]:
    """Those that have arrived, each once: with QoS 1 some may come again."""
    return sorted({message["data"]["sequence"] for _, message in subscriber.messages})


@contextmanager
def saved(running: AbstractContextManager[subprocess.Popen[bytes]]) -> Iterator[None]:
    """A broker that saves its sessions at the end."""
    with running as process:
        yield
        process.terminate()
        process.wait(PATIENCE)


def test_mqtt_has_each_event(client: HullClient, address: str, name: str, tmp_path: Path, port: int) -> None:
    with broker(mosquitto(tmp_path, port), port):
        subscriber = Subscriber(port)
        with relay_process(address, tmp_path, name, "--to", f"mqtt://127.0.0.1:{port}/plant/{{type}}"):
            pass_through(client, name, KEYS)
            wait_until(lambda: acknowledged(client, name) == 6)
        wait_until(lambda: len(subscriber.messages) == 6)
    assert [message["data"]["sequence"] for _, message in subscriber.messages] == [1, 2, 3, 4, 5, 6]
    assert {topic for topic, _ in subscriber.messages} == {"plant/enter", "plant/exit"}


def test_mqtt_refuses(client: HullClient, address: str, name: str, tmp_path: Path, port: int) -> None:
    """A broker answers a publication that it refuses, too: that is no delivery."""
    rights = tmp_path / "rights"
    rights.write_text("topic write plant/exit\ntopic read #\n")
    with broker(mosquitto(tmp_path, port, f"acl_file {rights}"), port):
        subscriber = Subscriber(port)
        to = ("--to", f"mqtt://127.0.0.1:{port}/plant/{{type}}", "--attempts", "2", *FAST)
        with relay_process(address, tmp_path, name, *to):
            pass_through(client, name, KEYS)
            wait_until(lambda: acknowledged(client, name) == 6)
        wait_until(lambda: len(subscriber.messages) == 3)
    assert {topic for topic, _ in subscriber.messages} == {"plant/exit"}
    listed = run("relay", "dead-letters", "list", "--state", tmp_path / "relay", "--json").stdout
    letters = [json.loads(line) for line in listed.splitlines()]
    assert [(each["event"]["data"]["type"], each["attempts"]) for each in letters] == [("enter", 2)] * 3
    assert {each["reason"] for each in letters} == {"MQTT: refused: Not authorized"}


class OldMqtt(socketserver.ThreadingTCPServer):
    """A broker of MQTT 3.1.1, as some are: it refuses other versions. It collects topics and acknowledges."""

    daemon_threads = True

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), OldMqttConnection)
        self.topics: list[str] = []


class OldMqttConnection(socketserver.StreamRequestHandler):
    server: OldMqtt

    def handle(self) -> None:
        while head := self.rfile.read(1):
            length, shift = 0, 0
            while True:
                (byte,) = self.rfile.read(1)
                length, shift = length | (byte & 127) << shift, shift + 7
                if byte < 128:
                    break
            body = self.rfile.read(length)
            if head[0] >> 4 == 1:  # CONNECT
                is_mine = body[6] == 4
                self.wfile.write(bytes([0x20, 2, 0, not is_mine]))
                if not is_mine:
                    return
            if head[0] >> 4 == 3:  # PUBLISH
                end = 2 + int.from_bytes(body[:2])
                self.server.topics.append(body[2:end].decode())
                self.wfile.write(b"\x40\x02" + body[end : end + 2])


def test_a_broker_that_only_knows_an_older_mqtt(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    with OldMqtt() as old:
        serving = threading.Thread(target=old.serve_forever, args=(0.01,))
        serving.start()
        try:
            to = f"mqtt://127.0.0.1:{old.server_address[1]}/plant/{{type}}"
            with relay_process(address, tmp_path, name, "--to", to, *FAST):
                pass_through(client, name, KEYS)
                wait_until(lambda: acknowledged(client, name) == 6)
        finally:
            old.shutdown()
            serving.join()
    assert sorted(old.topics) == ["plant/enter"] * 3 + ["plant/exit"] * 3


def test_nats(client: HullClient, address: str, name: str, tmp_path: Path, port: int) -> None:
    command = nats_server(tmp_path, port)
    to = ("--to", f"nats://127.0.0.1:{port}/events.{{fence}}", "--timeout", "1s", *FAST)
    with relay_process(address, tmp_path, name, *to) as relay:
        pass_through(client, name, KEYS)
        relay.wait_for("not delivered, trying again")
        with broker(command, port):
            wait_until(lambda: any("no stream stores" in line["error"] for line in relay.said(TRYING)))
            asyncio.run(make_stream(port))
            wait_until(lambda: acknowledged(client, name) == 6)
        pass_through(client, name, KEYS)
        with broker(command, port):
            wait_until(lambda: acknowledged(client, name) == 12)
            relay.process.terminate()
            relay.process.wait(PATIENCE)
            client.delete_consumer(name, "test")  # as if nothing had been acknowledged: all events are sent again
            with relay_process(address, tmp_path, name, *to):
                wait_until(lambda: acknowledged(client, name) == 12)
            stored = asyncio.run(read_stream(port))
    assert [event["data"]["sequence"] for event in stored] == list(range(1, 13)), "each is stored once"


TRYING = "not delivered, trying again"


async def make_stream(port: int) -> None:
    connection = await nats.connect(f"nats://127.0.0.1:{port}")
    await connection.jetstream().add_stream(name="events", subjects=["events.>"])
    await connection.close()


async def read_stream(port: int) -> list[dict[str, Any]]:
    connection = await nats.connect(f"nats://127.0.0.1:{port}")
    stream = connection.jetstream()
    count = (await stream.stream_info("events")).state.messages
    found = [json.loads((await stream.get_msg("events", seq)).data) for seq in range(1, count + 1)]
    await connection.close()
    return found
