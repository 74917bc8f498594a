"""Events of alarms go where those of fences go, with the same promises."""

import asyncio
import json
import re
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import nats
import pytest
from brokers import broker, mosquitto, nats_server
from cases import slow
from command_line import dynhull
from metrics import scrape
from mortal_server import MortalServer
from patience import PATIENCE, wait_until
from ports import free_port
from receiver import Receiver, receiver
from relay_process import FAST, acknowledged, alarm, fence, grow_and_shrink, relay_process
from server_process import run
from subscriber import Subscriber

from dynhull_client import HullClient

PLAIN = ("--unsigned", "--allow-private", *FAST)


@pytest.fixture
def client(address: str, name: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        alarm(client, name)
        yield client


def test_an_alarm_and_a_fence_of_one_name(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    """One relay delivers both, each in its own order; the alarm is deleted, and then the fence."""
    fence(client, f"{name}/of")
    client.create_fence(name, area=[[0, 0], [1, 0], [0, 1]], subjects=f"{name}/of", initial="none")
    to = ("--to", f"{endpoint.url}/{{kind}}/{{name}}/{{type}}", "--metrics-port", 0)
    with relay_process(address, tmp_path, name, f"alarm:{name}", *to, *PLAIN) as relay:
        said = relay.wait_for("relaying")
        assert (said["fences"], said["alarms"]) == ([name], [name])
        grow_and_shrink(client, name, 2)
        client.put(f"{name}/of", ["k"], [[0.1, 0.1]])
        wait_until(lambda: acknowledged(client, name, "alarm") == 4 and acknowledged(client, name) == 1)
        page = scrape(f"127.0.0.1:{said['metrics_port']}")
        assert page[f'dynhull_relay_delivered_total{{alarm="{name}",fence=""}}'] == 4
        assert page[f'dynhull_relay_delivered_total{{alarm="",fence="{name}"}}'] == 1
        client.delete_alarm(name)
        wait_until(lambda: len(endpoint.events(name, "alarm")) == 5)
        client.delete_fence(name)
        relay.process.wait(PATIENCE)
    events = endpoint.events(name, "alarm")
    assert [event["type"].rpartition(".")[2] for event in events] == [
        "raised",
        "cleared",
        "raised",
        "cleared",
        "closed",
    ]
    assert [event["data"]["sequence"] for event in events] == [1, 2, 3, 4, 5]
    first = events[0]
    assert (first["type"], first["source"], first["subject"]) == ("dynhull.alarm.raised", f"/alarms/{name}", name)
    assert first["id"] == f"{first['data']['uid']}-1"
    assert {each: first["data"][each] for each in ("hull", "value", "bound", "previous", "cause")} == {
        "hull": name,
        "value": 12.0,
        "bound": 10.0,
        "previous": 2.0,
        "cause": ["batch"],
    }
    paths = {request.path for request in endpoint.accepted}
    assert {f"/hook/alarm/{name}/raised", f"/hook/fence/{name}/enter"} < paths


@slow
def test_kills_of_all_three(tmp_path: Path) -> None:
    server, to = MortalServer(tmp_path), []
    with ExitStack() as stack, HullClient(server.address) as client:
        stack.callback(server.kill)
        endpoint = stack.enter_context(receiver())
        to = ("alarm:a", "--to", endpoint.url, *PLAIN)
        alarm(client, "a")
        with relay_process(server.address, tmp_path, *to, killed=True) as relay:
            grow_and_shrink(client, "a", 3)
            wait_until(lambda: endpoint.events("a", "alarm"))
            endpoint.stop()
            grow_and_shrink(client, "a", 3)
            relay.wait_for("not delivered, trying again")
            server.kill()
            relay.process.kill()
        with relay_process(server.address, tmp_path, *to) as relay:
            relay.wait_for("waiting for the server")
            server.start()
            endpoint.start()
            grow_and_shrink(client, "a", 3)
            wait_until(lambda: acknowledged(client, "a", "alarm") == 18)
    unique = {event["id"]: event["data"] for event in endpoint.events("a", "alarm")}
    assert [each["sequence"] for each in unique.values()] == list(range(1, 19))
    assert [each["type"] for each in unique.values()] == ["raised", "cleared"] * 9


def test_a_restored_server_tells_who_is_raised(tmp_path: Path) -> None:
    server, file = MortalServer(tmp_path), tmp_path / "events"
    with ExitStack() as stack:
        stack.callback(server.kill)
        client = stack.enter_context(HullClient(server.address))
        alarm(client, "a")
        stack.enter_context(relay_process(server.address, tmp_path, "alarm:a", "--to", file, *FAST))
        client.put("a", ["c"], [[0, 6]])
        wait_until(lambda: acknowledged(client, "a", "alarm") == 1)
        assert dynhull("backup", tmp_path / "backup", "--data", tmp_path / "data").exit_code == 0
        client.put("a", ["c"], [[0, 1]])
        wait_until(lambda: acknowledged(client, "a", "alarm") == 2)
        server.kill()
        (tmp_path / "data").rename(tmp_path / "lost")
        assert dynhull("restore", tmp_path / "backup", "--data", tmp_path / "data").exit_code == 0
        server.start()
        client.put("a", ["c"], [[0, 1]])
        wait_until(lambda: acknowledged(client, "a", "alarm") >= 4)
    events = [json.loads(line) for line in file.read_text().splitlines()]
    assert [event["type"].rpartition(".")[2] for event in events] == [
        "raised",
        "cleared",
        "lost",
        "snapshot",
        "cleared",
    ]
    assert events[3]["data"]["raised"] == ["a"]
    assert len({event["id"] for event in events}) == 5
    assert len({event["data"]["uid"] for event in events}) == 2, "no number of before names a new event"


def test_topics_of_mqtt(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    port = free_port()
    with broker(mosquitto(tmp_path, port), port):
        subscriber = Subscriber(port)
        with relay_process(address, tmp_path, f"alarm:{name}", "--to", f"mqtt://127.0.0.1:{port}", *FAST):
            grow_and_shrink(client, name, 1)
            wait_until(lambda: acknowledged(client, name, "alarm") == 2)
        wait_until(lambda: len(subscriber.messages) == 2)
    assert [topic for topic, _ in subscriber.messages] == [
        f"dynhull/alarm/{name}/{each}" for each in ("raised", "cleared")
    ]


def test_subjects_of_nats(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    port = free_port()

    async def stored() -> list[tuple[str, dict[str, Any]]]:
        async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
            stream = connection.jetstream()
            return [
                (message.subject, json.loads(message.data))
                for message in [await stream.get_msg("alarms", seq) for seq in (1, 2)]
            ]

    async def make() -> None:
        async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
            await connection.jetstream().add_stream(name="alarms", subjects=["dynhull.alarm.>"])

    with broker(nats_server(tmp_path, port), port):
        asyncio.run(make())
        with relay_process(address, tmp_path, f"alarm:{name}", "--to", f"nats://127.0.0.1:{port}", *FAST):
            grow_and_shrink(client, name, 1)
            wait_until(lambda: acknowledged(client, name, "alarm") == 2)
        found = asyncio.run(stored())
    assert [subject for subject, _ in found] == [f"dynhull.alarm.{name}.{each}" for each in ("raised", "cleared")]


def test_a_dead_letter_of_an_alarm_is_sent_again(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    state = ("--state", tmp_path / "relay")
    endpoint.answer = lambda _: (422, {})
    with relay_process(address, tmp_path, f"alarm:{name}", "--to", endpoint.url, "--attempts", 1, *PLAIN):
        grow_and_shrink(client, name, 1)
        wait_until(lambda: acknowledged(client, name, "alarm") == 2)
    endpoint.answer = lambda _: (200, {})
    to = ("--to", endpoint.url, "--unsigned", "--allow-private")
    assert run("relay", "dead-letters", "send", *state, *to).stdout == "2 sent\n"
    assert [event["data"]["type"] for event in endpoint.events(name, "alarm")] == ["raised", "cleared"]


@pytest.mark.parametrize(
    ("source", "to", "complaint"),
    [
        ("alarm:none", "events", r"there is no alarm 'none'[^`]*`dynhull alarms list` shows"),
        ("alarm:", "events", "name"),
        ("alarm:a", "mqtt://a/{fence}", r"--to has \{fence\}, but alarm:a is no fence: \{name\} is the name of either"),
    ],
)
def test_what_is_wrong_is_named(
    source: str, to: str, complaint: str, address: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = dynhull("relay", source, "--consumer", "test", "--state", tmp_path, "--address", address, "--to", to)
    assert done.exit_code in (1, 2)
    assert re.search(complaint, done.stderr), done.stderr
