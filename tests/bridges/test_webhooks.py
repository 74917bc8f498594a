"""Events of fences arrive at a real HTTP endpoint: all of them, in order, signed, whatever it answers."""

import base64
import json
import socket
import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from email.utils import format_datetime
from pathlib import Path

import numpy as np
import pytest
from cases import slow
from command_line import dynhull
from metrics import scrape
from patience import PATIENCE, wait_until
from receiver import Received, Receiver
from relay_process import FAST, acknowledged, fence, pass_through, relay_process
from server_process import run, server_process
from standardwebhooks import Webhook

from dynhull_client import HullClient

KEYS = [f"truck-{i}" for i in range(5)]
OLD, NEW = (f"whsec_{base64.b64encode(bytes([i]) * 32).decode()}" for i in (1, 2))
PLAIN = ("--unsigned", "--allow-private", *FAST)


@pytest.fixture
def client(address: str, name: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        fence(client, name)
        yield client


def sequences(endpoint: Receiver, name: str) -> list[int]:
    return [event["data"]["sequence"] for event in endpoint.events(name)]


def test_events_arrive_in_order_signed_and_are_acknowledged(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DYNHULL_WEBHOOK_SECRET", f"{OLD} {NEW}")
    with relay_process(address, tmp_path, name, "--to", endpoint.url, "--allow-private"):
        pass_through(client, name, KEYS)
        wait_until(lambda: acknowledged(client, name) == 10)
    assert sequences(endpoint, name) == list(range(1, 11))
    fence = client.get_fence(name)
    for number, request in enumerate(endpoint.accepted, start=1):
        for secret in (OLD, NEW):
            Webhook(secret).verify(request.body, request.headers)
        assert request.headers["content-type"] == "application/cloudevents+json"
        (event,) = request.events
        assert request.headers["webhook-id"] == event["id"] == f"{fence.uid}-{number}"
    assert endpoint.accepted[0].events[0] == {
        "specversion": "1.0",
        "id": f"{fence.uid}-1",
        "source": f"/fences/{name}",
        "type": "dynhull.fence.enter",
        "sequence": "00000000000000000001",
        "subject": "truck-0",
        "time": event_time(endpoint.accepted[0]),
        "datacontenttype": "application/json",
        "data": {
            "type": "enter",
            "fence": name,
            "sequence": 1,
            "uid": fence.uid,
            "hull": name,
            "key": "truck-0",
            "cause": ["subject_appeared"],
            "position": [1.0, 1.0],
            "distance": 0.0,
            "revision": 1,
            "time": event_time(endpoint.accepted[0]),
        },
    }
    assert fence.consumers[0].backlog == 0


def event_time(request: Received) -> str:
    text = request.events[0]["time"]
    assert abs(datetime.now(UTC) - datetime.fromisoformat(text)) < timedelta(minutes=5)
    return str(text)


def test_failures_are_repeated_with_the_same_id(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    statuses = iter([500, 503, 302, 408, 425, 429, 400])
    endpoint.answer = lambda _: (next(statuses, 200), {"Location": endpoint.url + "/elsewhere"})
    with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN) as relay:
        pass_through(client, name, KEYS)
        wait_until(lambda: acknowledged(client, name) == 10)
        assert len(relay.said("not delivered, trying again")) == 7
    assert sequences(endpoint, name) == list(range(1, 11))
    assert {request.path for request in endpoint.received} == {"/hook"}  # no redirect is followed
    assert len({request.headers["webhook-id"] for request in endpoint.received[:8]}) == 1


@pytest.mark.parametrize("form", ["seconds", "date"])
def test_an_endpoint_says_when_to_come_back(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path, form: str
) -> None:
    asked: list[float] = []

    def later(_: Received) -> tuple[int, dict[str, str]]:
        asked.append(time.time())
        if len(asked) > 1:
            return 200, {}
        then = datetime.fromtimestamp(asked[0] + 2, UTC)
        return 429, {"Retry-After": "2" if form == "seconds" else format_datetime(then, usegmt=True)}

    endpoint.answer = later
    with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN):
        pass_through(client, name, ["truck"])
        wait_until(lambda: acknowledged(client, name) == 2)
    assert asked[1] - asked[0] >= 0.9  # a date has whole seconds


def test_an_odd_time_to_come_back_ends_nothing(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    odd = iter(
        ["Wed, 21 Oct 99999999999999999999 07:28:00 GMT", "Wed, 21 Oct 2015 07:28:00 +99999999999999999999", "-1"]
    )
    endpoint.answer = lambda _: next(((503, {"Retry-After": each}) for each in odd), (200, {}))
    with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN):
        pass_through(client, name, ["truck"])
        wait_until(lambda: acknowledged(client, name) == 2)
    assert sequences(endpoint, name) == [1, 2]


def test_what_is_refused_becomes_a_dead_letter_and_can_be_sent_again(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    endpoint.answer = lambda request: (422 if '"truck-1"' in request.body else 200, {})
    to = ("--to", endpoint.url)
    with relay_process(address, tmp_path, name, *to, *PLAIN, "--attempts", 3):
        pass_through(client, name, KEYS)
        wait_until(lambda: acknowledged(client, name) == 10)
    assert sequences(endpoint, name) == [1, 2, 5, 6, 7, 8, 9, 10]
    assert sum('"truck-1"' in request.body for request in endpoint.received) == 6

    state = ("--state", str(tmp_path / "relay"))
    listed = [json.loads(line) for line in run("relay", "dead-letters", "list", *state, "--json").stdout.splitlines()]
    uid = client.get_fence(name).uid
    assert [each["id"] for each in listed] == [f"{uid}-3", f"{uid}-4"]
    assert listed[0]["to"] == endpoint.url
    assert (listed[0]["attempts"], listed[0]["event"]["subject"]) == (3, "truck-1")
    assert "HTTP 422" in listed[0]["reason"]

    send = ("relay", "dead-letters", "send", *state, *to, "--unsigned", "--allow-private")
    refused = run(*send)
    assert (refused.returncode, refused.stdout) == (1, "0 sent\n")
    assert "HTTP 422" in refused.stderr
    unknown = run(*send, "nobody")
    assert (unknown.returncode, unknown.stderr.count("\n")) == (2, 1)
    assert "has no dead letter nobody" in unknown.stderr
    endpoint.answer = lambda _: (204, {})
    assert run(*send, f"{uid}-4").stdout == "1 sent\n"
    assert run(*send).stdout == "1 sent\n"
    assert [request.events[0]["id"] for request in endpoint.accepted[-2:]] == [f"{uid}-4", f"{uid}-3"]
    assert run("relay", "dead-letters", "list", *state).stdout == ""


def test_an_endpoint_that_is_gone_is_left_alone(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    endpoint.answer = lambda _: (410, {})
    to = ("--to", endpoint.url)
    with relay_process(address, tmp_path, name, *to, *PLAIN, code=1) as relay:
        pass_through(client, name, ["truck"])
        relay.process.wait()
    with relay_process(address, tmp_path, name, *to, *PLAIN, code=2) as relay:
        relay.process.wait()
    assert len(endpoint.received) == 1
    endpoint.answer = lambda _: (200, {})
    with relay_process(address, tmp_path, name, *to, *PLAIN, "--enable"):
        wait_until(lambda: acknowledged(client, name) == 2)
    assert sequences(endpoint, name) == [1, 2]


def test_a_server_at_a_limit_ends_no_relay(tmp_path: Path, endpoint: Receiver) -> None:
    """As with a full disk, the server refuses at the start, and later it does not."""
    with (
        server_process("--max-streams", "1") as server,
        HullClient(server.address) as client,
        client.watch("other", follow=True) as other,
    ):
        fence(client, "yard")
        client.create_hull("other")
        next(other)
        with relay_process(server.address, tmp_path, "yard", "--to", endpoint.url, *PLAIN) as relay:
            assert "max_streams" in relay.wait_for("no events from the server, trying again")["error"]
            other.close()
            wait_until(lambda: client.get_fence("yard").consumers)
            pass_through(client, "yard", ["truck"])
            wait_until(lambda: acknowledged(client, "yard") == 2)


def test_a_dead_letter_that_cannot_be_kept_ends_no_relay(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    """The event is tried again until the receiver wants it, or the relay's disk has room."""
    endpoint.answer = lambda request: (422 if '"truck"' in request.body else 200, {})
    letters = tmp_path / "relay" / "dead-letters"
    letters.parent.mkdir()
    letters.write_text("no folder")
    with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN, "--attempts", 1) as relay:
        pass_through(client, name, ["truck"])
        relay.wait_for("no dead letter can be kept")
        letters.unlink()
        wait_until(lambda: acknowledged(client, name) == 2)
    assert len(list(letters.glob("*.json"))) == 2


def test_a_stalled_endpoint_of_one_fence_holds_up_no_other(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    slow, answering = f"{name}-slow", []
    fence(client, slow)

    def answer(request: Received) -> tuple[int, dict[str, str]]:
        if request.path.endswith("slow"):
            answering.append(request)
            wait_until(lambda: len(sequences(endpoint, name)) == 10)
        return 200, {}

    endpoint.answer = answer
    with relay_process(address, tmp_path, name, slow, "--to", f"{endpoint.url}/{{fence}}", *PLAIN):
        pass_through(client, slow, ["truck"])
        wait_until(lambda: answering)
        pass_through(client, name, KEYS)
        wait_until(lambda: acknowledged(client, name) == 10 and acknowledged(client, slow) == 2)
    assert {request.path for request in endpoint.accepted} == {f"/hook/{name}", f"/hook/{slow}"}


def test_sigterm_lets_a_delivery_finish(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN) as relay:

        def answer(_: Received) -> tuple[int, dict[str, str]]:
            relay.process.terminate()
            relay.wait_for("stopping when the deliveries under way are done")
            return 200, {}

        endpoint.answer = answer
        pass_through(client, name, KEYS)
        relay.process.wait()
    assert sequences(endpoint, name) == [1]
    assert acknowledged(client, name) == 1


def test_sigterm_ends_a_pause(client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path) -> None:
    endpoint.answer = lambda _: (503, {"Retry-After": "3600"})
    with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN) as relay:
        pass_through(client, name, KEYS)
        assert relay.wait_for("not delivered, trying again")["pause"] == 3600
        relay.process.terminate()
        relay.process.wait(PATIENCE)
    assert acknowledged(client, name) == 0


@slow
@pytest.mark.long
def test_a_watcher_that_the_server_gave_up_delivers_nothing_twice(tmp_path: Path, endpoint: Receiver) -> None:
    hold, total = threading.Event(), 4000

    def answer(_: Received) -> tuple[int, dict[str, str]]:
        hold.wait()
        time.sleep(0.2)  # slow: when the watch begins again, events wait in the relay
        return 200, {}

    endpoint.answer = answer
    options = ("--max-watch-lag", "0.5", "--metrics-port", "0")
    with server_process(*options) as server, HullClient(server.address) as client:
        metrics = server.process.stdout.readline().split("/")[2]
        fence(client, "a")
        keys = [f"{i:0200}" for i in range(total)]
        with relay_process(server.address, tmp_path, "a", "--to", endpoint.url, "--batch", 1000, *PLAIN) as relay:
            wait_until(lambda: client.get_fence("a").consumers)
            events = 0
            while (lag := scrape(metrics)["dynhull_watch_lag_seconds"]) <= 0.5:
                if lag == 0:  # gRPC takes more ahead where answers are slower
                    client.put("a", keys, np.ones((total, 2)))
                    client.put("a", keys, 9 * np.ones((total, 2)))
                    events += 2 * total
            hold.set()
            wait_until(lambda: acknowledged(client, "a") == events)
            assert relay.said("no events from the server, trying again")
    assert sequences(endpoint, "a") == list(range(1, events + 1))


def test_batches(client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path) -> None:
    pass_through(client, name, KEYS)
    with relay_process(address, tmp_path, name, "--to", endpoint.url, "--batch", 4, *PLAIN):
        wait_until(lambda: acknowledged(client, name) == 10)
    assert sequences(endpoint, name) == list(range(1, 11))
    assert max(len(request.events) for request in endpoint.accepted) in (2, 3, 4)
    assert {request.headers["content-type"] for request in endpoint.accepted} == {"application/cloudevents-batch+json"}


def test_the_metrics_page(client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path) -> None:
    endpoint.answer = lambda request: (500 if '"truck-1"' in request.body else 200, {})
    with relay_process(address, tmp_path, name, "--to", endpoint.url, "--metrics-port", 0, *PLAIN) as relay:
        page = f"127.0.0.1:{relay.wait_for('relaying')['metrics_port']}"
        assert scrape(page)[f'dynhull_relay_delivered_total{{alarm="",fence="{name}"}}'] == 0
        pass_through(client, name, KEYS)
        wait_until(lambda: acknowledged(client, name) == 2)
        wait_until(lambda: scrape(page).get(f'dynhull_relay_backlog{{alarm="",fence="{name}"}}') == 8)
        taken = page.rpartition(":")[2]
        options = ("--address", address, "--consumer", "other", "--to", tmp_path / "other", "--metrics-port", taken)
        refused = dynhull("relay", name, *options)
        assert refused.exit_code == 2
        assert f"--metrics-port {taken}: cannot listen on 127.0.0.1: another program uses this port" in refused.stderr
        figures = scrape(page)
        assert figures[f'dynhull_relay_delivered_total{{alarm="",fence="{name}"}}'] == 2
        assert figures[f'dynhull_relay_failed_total{{alarm="",fence="{name}"}}'] >= 1
        assert 0 < figures[f'dynhull_relay_oldest_seconds{{alarm="",fence="{name}"}}'] < 300


def test_a_relay_ends_when_its_fence_is_deleted(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    client.put(name, ["truck"], [[1, 1]])
    with relay_process(address, tmp_path, name, "--to", endpoint.url, *PLAIN) as relay:
        wait_until(lambda: acknowledged(client, name) == 1)
        client.delete_fence(name)
        relay.process.wait()
    last = endpoint.events(name)[-1]
    assert (last["type"], last["data"]["inside"][0]["keys"]) == ("dynhull.fence.closed", ["truck"])


@pytest.mark.parametrize(
    ("options", "complaint"),
    [
        (["--to", "http://127.0.0.1:1"], "webhooks are signed: give --secret or DYNHULL_WEBHOOK_SECRET, or --unsigned"),
        (["--to", "http://127.0.0.1:1", "--unsigned"], "is a private address: allow it with --allow-private"),
        (["--to", "http://[::ffff:7f00:1]/", "--unsigned"], "is a private address: allow it with --allow-private"),
        (["--to", "https://user:word@localhost/?key=word", "--unsigned"], "--to https://localhost/ is a private"),
        (["--to", "http://{fence}/", "--unsigned"], "has no host of its own"),
        (["--to", "gopher://a"], "--to gopher: must be a URL of http, https, mqtt"),
        (["--to", "http://a.example/", "--secret", "word"], "a secret must be whsec_ and base64"),
        (["--to", "http://a.example/", "--secret", "wörd"], "random bytes: look at --secret"),
        (["--to", ""], "--to is empty: give a URL, a file or -"),
        (["--to", "file.ndjson", "--batch", 2], "--batch is for webhooks"),
        (["--to", "mqtt://a/#"], "the topic '#' has a wildcard"),
        (["--to", "mqtt://a/#", "--secret", f"whsec_{'A' * 32}"], "the topic '#' has a wildcard"),  # not of the secret
        (["--to", "nats://a/b.>"], "the subject 'b.>' has a wildcard"),
        (["--to", "-", "--timeout", "0s"], "--timeout '0s' must be more than 0"),
        (["--to", "127.0.0.1:8000"], "did you mean http://127.0.0.1:8000? A file of that name is ./127.0.0.1:8000"),
        (["--to", "localhost:8000/hook"], "did you mean http://localhost:8000/hook?"),
        (["--to", "{fence}.ndjson"], "{kind}, {name} and {type} are filled in in URLs"),
        (
            ["--to", "mqtt://a/plant/{fnce}/{type}"],
            "--to: {fnce} is not {kind}, {name} or {type}; {{ and }} stand for braces",
        ),
        (["--to", "mqtt://a/plant/{fence"], "--to: {fence is not {kind}, {name} or {type}"),
        (["--to", "mqtt://a/b?version=5"], "no option 'version' after the question mark: there are none"),
        (["--to", "nats://a/ev ents"], "'ev ents' is no subject of NATS"),
        (["--to", "nats://a/events..{fence}"], "'events..{fence}' is no subject of NATS"),
    ],
)
def test_bad_options_are_named(options: list[object], complaint: str, tmp_path: Path) -> None:
    done = dynhull("relay", "zone", "--consumer", "test", "--state", tmp_path, "--address", "127.0.0.1:1", *options)
    assert done.exit_code == 2
    assert complaint in done.stderr
    assert "word@" not in done.stderr


def test_a_name_that_leads_home_gets_nothing(
    client: HullClient, address: str, name: str, endpoint: Receiver, tmp_path: Path
) -> None:
    url = endpoint.url.replace("127.0.0.1", socket.gethostname())  # a name like any other until it is resolved
    with relay_process(address, tmp_path, name, "--to", url, "--unsigned", *FAST) as relay:
        pass_through(client, name, ["truck"])
        assert "private address" in relay.wait_for("not delivered, trying again")["error"]
    assert endpoint.received == []


def test_a_consumer_that_no_fence_can_have(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    options = ("--address", address, "--consumer", "ä b", "--to", tmp_path / "events")
    refused = dynhull("relay", name, *options)
    assert refused.exit_code == 2
    assert "'ä b'" in refused.stderr
    assert client.get_fence(name).consumers == ()


def test_a_fence_that_does_not_exist(client: HullClient, address: str, name: str, tmp_path: Path) -> None:
    """All names are looked up first: the fence that exists gets no consumer, and who was gone stays so."""
    gone = tmp_path / "gone.json"
    gone.write_text("{}")
    options = ("--consumer", "test", "--state", tmp_path, "--address", address, "--to", "-", "--enable")
    done = run("relay", name, f"{name}-1", f"{name}-2", *options)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"there is no fence '{name}-1'\nthere is no fence '{name}-2'\n`dynhull fences list` shows" in done.stderr
    assert client.get_fence(name).consumers == ()
    assert gone.exists()
