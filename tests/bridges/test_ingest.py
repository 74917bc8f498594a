"""Messages of real brokers become points, each exactly once, whatever is killed."""

import asyncio
import json
import random
import signal
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import Any

import nats
import pytest
from brokers import broker, mosquitto, nats_server
from command_line import dynhull
from ingest_process import ingest_process, ingested
from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion
from patience import PATIENCE, wait_until
from ports import free_port
from proxy import proxy
from server_process import server_process

from dynhull_bridges.ingest import jetstream
from dynhull_client import HullClient, HullNotFoundError


@pytest.fixture(scope="module")
def nats_port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """A NATS server that tests share; each has a stream of its own."""
    port = free_port()
    with broker(nats_server(tmp_path_factory.mktemp("broker"), port), port):
        yield port


@pytest.fixture
def client(address: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        yield client


def publish(port: int, stream: str, messages: Sequence[tuple[str, Any]], *, anew: bool = False, **limits: int) -> None:
    """Publish to subjects below the stream's name; each message is stored when this returns."""

    async def run() -> None:
        async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
            context = connection.jetstream()
            if anew:
                await context.delete_stream(stream)
            await context.add_stream(name=stream, subjects=[f"{stream}.>"], **limits)
            for subject, message in messages:
                payload = message if isinstance(message, bytes) else json.dumps(message).encode()
                await context.publish(f"{stream}.{subject}", payload)

    asyncio.run(run())


def positions(client: HullClient, hull: str, keys: Sequence[str]) -> dict[str, tuple[float, ...]]:
    found = client.positions(hull, keys)
    return {key: tuple(place) for key, place in zip(keys, found.positions.tolist(), strict=True)}


def test_each_message_is_a_position_of_a_key(client: HullClient, address: str, name: str, nats_port: int) -> None:
    moves = [(f"v{i % 3}.position", {"lon": i % 7, "lat": i % 5, "ts": 1_700_000_000 + i}) for i in range(50)]
    publish(nats_port, name, moves)
    url = f"nats://127.0.0.1:{nats_port}/{name}/{name}.*.position"
    said = ingested(address, url, "--hull", name, "--key", "{1}", "--time", "$.ts")
    assert any("times are seconds since 1970, the first is 2023" in line["event"] for line in said)
    assert not [line for line in said if line["level"] == "warning"]
    assert said[-1] == {**said[-1], "event": "stopped", "points": 50, "bad": 0}
    last = {move[0].partition(".")[0]: move[1] for move in moves}
    assert positions(client, name, list(last)) == {key: (at["lon"], at["lat"]) for key, at in last.items()}
    info = client.get_hull(name).info
    assert (info.keyed, info.geographic) == ("str", True)
    publish(nats_port, name, [("v0.position", {"lon": 1, "lat": 1, "ts": 1_700_000_100}), ("v0.other", {})])
    said = ingested(address, url, "--hull", name, "--key", "{1}", "--time", "$.ts")
    assert [line["after"] for line in said if line["event"] == "reading"] == [50]
    assert said[-1]["points"] == 1


def test_sentences_of_receivers_are_positions(client: HullClient, address: str, name: str, nats_port: int) -> None:
    fix, other = b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47", b"$GPGSV,1,1,00*79"
    publish(nats_port, name, [("a", fix + b"\r\n" + other), ("b", other), ("c", fix[:-1] + b"8"), ("d", b"{}")])
    options = (f"nats://127.0.0.1:{nats_port}/{name}/{name}.*", "--hull", name, "--key", "{1}", "--format", "nmea")
    said = ingested(address, *options)
    assert (said[-1]["points"], said[-1]["bad"]) == (1, 2)
    assert positions(client, name, ["a"]) == {"a": (11 + 31 / 60, 48 + 7.038 / 60)}
    assert client.get_hull(name).info.geographic


def test_the_log_says_what_became_of_each_position(client: HullClient, address: str, name: str, nats_port: int) -> None:
    """The time of 2099 is refused and kept aside; the others are new, stale and too old for the window."""
    client.create_hull(name, keyed="str", ordering="event_time", max_age=5400, clock="data", max_skew=60)
    times = [("a", "2026-03-01T12:00:00Z"), ("b", "2099-01-01T00:00:00Z"), ("a", "2026-03-01T11:00:00Z"),
             ("c", "2026-03-01T10:00:00Z"), ("c", "2026-03-01T12:00:01Z"), ("a", "2026-03-01T12:00:01Z")]  # fmt: skip
    publish(nats_port, name, [(key, {"x": 1, "y": 2, "at": at}) for key, at in times])
    options = ("--hull", name, "--key", "{1}", "--x", "$.x", "--y", "$.y", "--time", "$.at")
    said = ingested(address, f"nats://127.0.0.1:{nats_port}/{name}/{name}.*", *options)
    counts = {"inserted": 2, "moved": 1, "stale": 1, "late": 1}
    ended = {each: value for each, value in said[-1].items() if each not in ("timestamp", "seconds", "level", "logger")}
    assert ended == {"event": "stopped", "points": 5, "bad": 1, **counts}


def test_messages_say_when_keys_leave_and_the_command_which_are_put(
    client: HullClient, address: str, name: str, nats_port: int
) -> None:
    """Times without a time zone are those of Berlin; one batch has a key that leaves and one that stays."""
    client.create_hull(name, keyed="str", max_age=86400, clock="data")
    at = {"x": 1, "y": 2, "at": "2026-03-01 13:00:00"}
    moves = [
        ("a", at | {"until": "2026-03-01 13:00:05"}),
        ("b", at | {"error": 2.5}),
        ("c", at | {"until": ""}),
        ("d", at | {"until": 7}),
        ("e", at | {"at": "2026-03-29 02:30:00"}),
        ("f", at | {"at": "2026-03-01T12:00:10Z"}),
    ]
    publish(nats_port, name, moves)
    url = f"nats://127.0.0.1:{nats_port}/{name}/{name}.*"
    options = ("--hull", name, "--key", "{1}", "--x", "$.x", "--y", "$.y", "--time", "$.at")
    berlin = ("--time-zone", "Europe/Berlin", "--time-format", "%Y-%m-%d %H:%M:%S")
    said = ingested(address, url, *options, *berlin, "--expires", "$.until", "--accuracy", "$.error")
    bad = [line["error"] for line in said if line["event"] == "bad message"]
    assert [each.partition(",")[0] for each in bad] == [
        "expires is '7'", "time is '2026-03-29 02:30:00'", "time is '2026-03-01T12:00:10Z'"
    ]  # fmt: skip
    assert said[-1] == {**said[-1], "points": 3, "bad": 3, "inserted": 3}
    entities = client.entities(name)
    assert entities.times is not None
    assert entities.accuracies is not None
    assert entities.accuracies.tolist() == [0, 2.5, 0]
    assert {str(each) for each in entities.times} == {"2026-03-01T12:00:00.000000"}
    client.put(name, ["z"], [[0, 0]], [datetime(2026, 3, 1, 12, 0, 10, tzinfo=UTC)])
    assert sorted(client.entities(name).keys) == ["b", "c", "z"]
    said = ingested(
        address, url, *options, *berlin, "--producer", "again", "--only", "absent", "--ttl", "1h", "--max-bad", "3"
    )
    assert said[-1] == {**said[-1], "points": 4, "bad": 2, "inserted": 2, "skipped": 2}
    client.put(name, ["z"], [[0, 0]], [datetime(2026, 3, 1, 13, 0, 20, tzinfo=UTC)])
    assert sorted(client.entities(name).keys) == ["b", "c", "z"]
    refused = dynhull("ingest", url, "--hull", name, "--ttl", "1h")
    assert (refused.exit_code, "--ttl is given with --key" in refused.stderr) == (2, True)


def test_messages_without_contents_delete_keys(client: HullClient, address: str, name: str, nats_port: int) -> None:
    """In the order of the log, and once: a key that comes back afterwards stays."""
    at = {"lon": 1, "lat": 2}
    unknown = {"lon": 181, "lat": 91}
    publish(nats_port, name, [("a", at), ("b", at), ("a", b""), ("b", b""), ("b", at), ("no", b""), ("c", unknown)])
    options = (f"nats://127.0.0.1:{nats_port}/{name}/{name}.*", "--hull", name, "--key", "{1}")
    said = ingested(address, *options, "--tombstones", "delete")
    (bad,) = (line["error"] for line in said if line["event"] == "bad message")
    assert bad == "lat is 91.0, which AIS writes where it is not available"
    assert (said[-1]["points"], said[-1]["bad"]) == (6, 1)
    assert client.get_hull(name).info.points == 1
    assert positions(client, name, ["b"]) == {"b": (1, 2)}


def test_a_mapping_that_looks_wrong_is_warned_about(address: str, name: str, nats_port: int) -> None:
    publish(nats_port, name, [("p", {"lon": 1, "lat": 2, "ts": 1_700_000_000})] * 3)
    options = ("--key", "{topic}", "--time", "$.ts", "--time-unit", "ms", "--x", "$.lat", "--y", "$.lon")
    url = f"nats://127.0.0.1:{nats_port}/{name}"
    said = ingested(address, url, "--hull", name, *options)
    first, second = [line["event"] for line in said if line["level"] == "warning"]
    assert first == "x is the longitude and y the latitude: the names say the opposite"
    assert second.startswith("time: 1700000000 milliseconds since 1970 are 1970-01-20T")
    said = ingested(address, url, "--hull", name, "--key", "{topic}", "--producer", "again")
    (only,) = [line["event"] for line in said if line["level"] == "warning"]
    assert only.startswith("the hull is a plane: longitudes and latitudes are its x and y")


def test_hulls_by_subject_and_several_points_a_message(
    client: HullClient, address: str, name: str, nats_port: int
) -> None:
    batch = {"fixes": [{"n": i, "p": [i, i * i]} for i in range(10)]}
    publish(nats_port, name, [("a", batch), ("x@y", batch), ("b", batch), ("a", {"fixes": [{"n": 3, "p": [-1, -1]}]})])
    url = f"nats://127.0.0.1:{nats_port}/{name}/{name}.*"
    options = ("--hull", f"{name}/{{1}}", "--each", "$.fixes", "--key", "$.n", "--x", "$.p[0]", "--y", "$.p[1]")
    said = ingested(address, url, *options)
    assert said[-1]["bad"] == 1, "no hull can have that name"
    assert client.get_hull(f"{name}/a").info.keyed == "int"
    assert client.positions(f"{name}/a", [3, 4]).positions.tolist() == [[-1, -1], [4, 16]]
    assert client.positions(f"{name}/b", [3]).positions.tolist() == [[3, 9]]
    assert client.get_hull(f"{name}/a").info.geographic is False
    said = ingested(address, url, *options)  # the place is kept by the broker, for there are several hulls
    assert [line["after"] for line in said if line["event"] == "reading"] == [4]
    assert any("--producer NAME reads all again" in line["event"] for line in said)


def test_each_mapping_has_its_own_place_in_the_log(client: HullClient, address: str, name: str, nats_port: int) -> None:
    """What one took as bad, another still reads; no hull takes a message twice."""
    publish(nats_port, name, [(f"v{i % 2}", {"lon": i, "lat": i}) for i in range(6)])
    options = (f"nats://127.0.0.1:{nats_port}/{name}/{name}.*", "--hull", f"{name}/{{1}}")
    assert ingested(address, *options, "--x", "$.lng")[-1]["bad"] == 6
    said = ingested(address, *options)
    assert [line["after"] for line in said if line["event"] == "reading"] == [0]
    assert said[-1]["points"] == 6
    again = ingested(address, *options, "--y", "$['lat']")[-1]
    assert (again["points"], again["known_before"]) == (0, 6)
    assert client.get_hull(f"{name}/v1").info.points == 3


def test_a_subject_that_the_stream_does_not_store(address: str, name: str, nats_port: int) -> None:
    publish(nats_port, name, [])
    url = f"nats://127.0.0.1:{nats_port}/{name}/trucks.*"
    with ingest_process(address, url, "--hull", name, code=2) as ingest:
        ingest.process.wait(PATIENCE)
        (said,) = ingest.lines()
    assert f"stores nothing of 'trucks.*': its subjects are {name}.>" in said


BAD = {
    b"{": "the message is no JSON",
    b"": "the message is empty",
    b"[1, 2]": "the key is missing",
    b'{"id": 1.5, "x": 1, "y": 1}': "the key is 1.5, not a string or an integer",
    b'{"id": "a", "x": 1}': "y is missing",
    b'{"id": "a", "x": "east", "y": 1}': "x is 'east', not a number",
    b'{"id": "a", "x": "inf", "y": 1}': "x is 'inf', not finite",
    b'{"id": "", "x": 1, "y": 1}': "the key is missing",
    b'{"id": "' + b"k" * 5000 + b'", "x": 1, "y": 1}': "the key is ",
}


def test_bad_messages_are_kept_aside(
    client: HullClient, address: str, name: str, nats_port: int, tmp_path: Path
) -> None:
    """Each as a line with its error; the good ones around them arrive."""
    client.create_hull(name, keyed="str")
    messages: list[tuple[str, Any]] = []
    for index, bad in enumerate(BAD):
        messages += [("p", {"id": f"good{index}", "x": index, "y": "-2.5"}), ("p", bad)]
    publish(nats_port, name, messages)
    url = f"nats://127.0.0.1:{nats_port}/{name}"
    options = ("--hull", name, "--key", "$.id", "--x", "$.x", "--y", "$.y")
    said = ingested(address, url, *options, "--bad", tmp_path / "bad.ndjson", "--metrics-port", "0")
    assert (said[-1]["points"], said[-1]["bad"]) == (len(BAD), len(BAD))
    kept = [json.loads(line) for line in (tmp_path / "bad.ndjson").read_text().splitlines()]
    assert sorted(line["number"] for line in kept) == list(range(2, 2 * len(BAD) + 1, 2))
    for line in kept:
        bad = line["payload"].encode()
        assert line["topic"] == f"{name}.p"
        assert line["error"].startswith(BAD[bad]), line
    keys = [f"good{index}" for index in range(len(BAD))]
    assert positions(client, name, keys) == {key: (index, -2.5) for index, key in enumerate(keys)}
    client.create_hull(f"{name}-2", keyed="str")
    with ingest_process(address, url, *options[2:], "--hull", f"{name}-2", "--max-bad", "1", code=1) as ingest:
        ingest.process.wait(PATIENCE)
        assert "more than 1 bad messages" in ingest.lines()[-1]


def test_what_is_wrong_with_all_messages_passes_over_none(
    client: HullClient, address: str, name: str, nats_port: int
) -> None:
    """A hull whose clock is that of the data needs event times."""
    client.create_hull(name, keyed="str", max_age=60, clock="data")
    publish(nats_port, name, [("p", {"id": "a", "lon": 1, "lat": 2, "ts": 1_700_000_000 + i}) for i in range(3)])
    options = (f"nats://127.0.0.1:{nats_port}/{name}", "--hull", name, "--key", "$.id")
    with ingest_process(address, *options, code=2) as ingest:
        ingest.process.wait(PATIENCE)
        assert "each row needs one" in ingest.lines()[-1]
    assert client.last_sequence(name, f"nats/{name}") == 0
    assert ingested(address, *options, "--time", "$.ts")[-1]["points"] == 3


def test_whatever_is_killed_each_message_is_applied_once(name: str, tmp_path: Path) -> None:
    """Points without keys: one that came twice would be counted twice."""
    port = free_port()
    kept = ("--data", str(tmp_path / "data"), "--port", str(free_port()))
    rng = random.Random(5)
    with server_process(*kept, killed=True) as server:
        address = server.address
        options = (f"nats://127.0.0.1:{port}/{name}", "--hull", name, "--x", "$[0]", "--y", "$[1]", "--plane")
        with broker(nats_server(tmp_path, port), port):
            publish(port, name, [("p", [i, i * i]) for i in range(1000)])
            with ingest_process(address, *options, killed=True) as ingest:
                ingest.wait_for("reading")
                publish(port, name, [("p", [i, i * i]) for i in range(1000, 1000 + rng.randrange(500))])
                ingest.process.kill()
            with ingest_process(address, *options, killed=True) as ingest:
                ingest.wait_for("reading")
                server.process.kill()
                server.process.wait()
                publish(port, name, [("p", [i, i * i]) for i in range(2000, 2500)])
                ingest.process.kill()
    with server_process(*kept) as server, HullClient(server.address) as client:
        with ingest_process(server.address, *options) as first, ingest_process(server.address, *options) as second:
            first.wait_for("no messages from the broker, trying again")
            with broker(nats_server(tmp_path, port), port):
                publish(port, name, [("p", [i, i * i]) for i in range(3000, 3500)])
                total = stored(port, name)
                second.wait_for("reading")
                wait_until(lambda: last_sequence(client, name, f"nats/{name}") == total)
        with broker(nats_server(tmp_path, port), port):
            ingested(server.address, *options)
        info = client.get_hull(name).info
        assert (info.points, info.distinct) == (total, total)


def last_sequence(client: HullClient, hull: str, producer: str) -> int:
    try:
        return client.last_sequence(hull, producer)
    except HullNotFoundError:
        return 0


def stored(port: int, stream: str) -> int:
    async def run() -> int:
        async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
            return (await connection.jetstream().stream_info(stream)).state.messages

    return asyncio.run(run())


@pytest.mark.parametrize("stored", [1, 3, 5], ids=["shorter", "as long", "longer"])
def test_a_stream_that_was_created_again_is_refused(address: str, name: str, nats_port: int, stored: int) -> None:
    """Its messages count from 1 again, so those with numbers that the hull knows would be passed over."""
    options = (f"nats://127.0.0.1:{nats_port}/{name}", "--hull", name, "--x", "$.x", "--y", "$.y")
    publish(nats_port, name, [("p", {"x": 1, "y": 1})] * 3)
    ingested(address, *options)
    publish(nats_port, name, [("p", {"x": 1, "y": 1})] * stored, anew=True)
    refused(address, *options)
    said = ingested(address, *options, "--producer", "again")
    assert said[-1]["points"] == stored


def refused(address: str, *options: object) -> None:
    with ingest_process(address, *options, "--to-end", code=2) as ingest:
        ingest.process.wait(PATIENCE)
        assert "was created again. Give another --producer" in ingest.lines()[-1]


def test_a_stream_that_was_created_again_under_hulls_by_subject(address: str, name: str, nats_port: int) -> None:
    """The broker keeps the place, and each hull knows its stream: the place may be lost with the stream."""
    url = f"nats://127.0.0.1:{nats_port}/{name}/{name}.*"
    options = (url, "--hull", f"{name}/{{1}}", "--x", "$.x", "--y", "$.y")
    publish(nats_port, name, [("a", {"x": 1, "y": 1})] * 3)
    assert ingested(address, *options)[-1]["points"] == 3
    publish(nats_port, name, [(each, {"x": 1, "y": 1}) for each in "aaabb"], anew=True)
    refused(address, *options)
    refused(address, *options[:-1], "$['y']")


def test_a_stream_that_is_created_again_meanwhile(address: str, name: str, nats_port: int) -> None:
    options = (f"nats://127.0.0.1:{nats_port}/{name}", "--hull", name, "--x", "$.x", "--y", "$.y")
    publish(nats_port, name, [("p", {"x": 1, "y": 1})] * 3)
    with ingest_process(address, *options, code=2) as ingest, HullClient(address) as client:
        wait_until(lambda: last_sequence(client, name, f"nats/{name}") == 3)
        publish(nats_port, name, [("p", {"x": 1, "y": 1})] * 5, anew=True)
        ingest.process.wait(PATIENCE)
        assert "was created again. Give another --producer" in ingest.lines()[-1]


def test_a_hull_without_the_identity_of_its_stream_adopts_it(
    client: HullClient, address: str, name: str, nats_port: int
) -> None:
    """As the first ingest after an upgrade does: the hull has only the numbers."""
    options = (f"nats://127.0.0.1:{nats_port}/{name}", "--hull", name, "--x", "$.x", "--y", "$.y")
    publish(nats_port, name, [("p", {"x": 1, "y": 1})] * 3)
    client.create_hull(name)
    client.apply(name, insert=[[1, 1]] * 2, producer=f"nats/{name}", sequence=2, may_skip=True)
    said = ingested(address, *options)
    assert [line["feed"] for line in said if "taken for this log" in line["event"]] == [options[0]]
    assert said[-1]["points"] == 1
    assert not [line for line in ingested(address, *options) if "taken for this log" in line["event"]]
    publish(nats_port, name, [("p", {"x": 1, "y": 1})] * 5, anew=True)
    refused(address, *options)


def test_what_the_stream_removed_before_it_was_read(address: str, name: str, nats_port: int) -> None:
    """It is named, and an error unless gaps are accepted."""
    options = (f"nats://127.0.0.1:{nats_port}/{name}", "--hull", name, "--x", "$.x", "--y", "$.y")
    message = ("p", {"x": 1, "y": 1})
    publish(nats_port, name, [message] * 8, max_msgs=5)
    assert ingested(address, *options)[-1]["points"] == 5, "nothing before the first start is missed"
    publish(nats_port, name, [message] * 8, max_msgs=5)
    with ingest_process(address, *options, "--to-end", code=1) as ingest:
        ingest.process.wait(PATIENCE)
        assert "messages 9 to 11, 3 at most, were removed before they were read: --accept-gaps" in ingest.lines()[-1]
    said = ingested(address, *options, "--accept-gaps")
    assert (said[-1]["points"], said[-1]["lost"]) == (5, 3)
    assert [(line["first"], line["last"]) for line in said if line["level"] == "warning"] == [(9, 11)]
    assert "lost" not in ingested(address, *options)[-1]


def test_what_the_stream_replaced_by_newer_messages_of_its_subject_is_no_gap(
    address: str, name: str, nats_port: int
) -> None:
    options = (f"nats://127.0.0.1:{nats_port}/{name}", "--hull", name, "--key", "{topic}")
    for _ in range(2):
        publish(nats_port, name, [("p", {"lon": i, "lat": 1}) for i in range(3)], max_msgs_per_subject=1)
        assert ingested(address, *options)[-1]["points"] == 1


def test_what_the_stream_removes_while_it_is_read(monkeypatch: pytest.MonkeyPatch, name: str, nats_port: int) -> None:
    """A feed asks for one message at a time, and the stream keeps one."""
    monkeypatch.setattr(jetstream, "PULLED", 1)
    publish(nats_port, name, [("p", {})], max_msgs=1)

    async def read() -> list[tuple[int, int]]:
        feed = jetstream.JetStreamSource(f"nats://127.0.0.1:{nats_port}/{name}", None, "mapping")
        await feed.begin(0)
        found = [*await feed.read()]
        while not found:
            found += await feed.read()
        await asyncio.to_thread(publish, nats_port, name, [("p", {})] * 3, max_msgs=1)
        while found[-1].number < 4:
            found += await feed.read()
        await feed.close()
        return [(each.number, each.lost) for each in found]

    found = asyncio.run(read())
    numbers = [number for number, _ in found]
    assert (numbers[0], numbers[-1]) == (1, 4), "those between were read, or removed before they were asked for"
    assert [lost for _, lost in found] == [0, *(after - before - 1 for before, after in pairwise(numbers))]


def test_a_place_without_the_identity_of_its_stream_adopts_it(address: str, name: str, nats_port: int) -> None:
    """As the broker kept it before an upgrade, for several hulls."""
    url = f"nats://127.0.0.1:{nats_port}/{name}/{name}.*"
    options = (url, "--hull", f"{name}/{{1}}", "--x", "$.x", "--y", "$.y")
    publish(nats_port, name, [("a", {"x": 1, "y": 1})] * 3)
    ingested(address, *options)

    async def forget() -> None:
        async with await nats.connect(f"nats://127.0.0.1:{nats_port}") as connection:
            bucket = await connection.jetstream().key_value("dynhull-ingest")
            (key,) = [each for each in await bucket.keys() if f"nats/{name}/" in each]
            value = (await bucket.get(key)).value or b""
            await bucket.put(key, value.split()[0])

    asyncio.run(forget())
    said = ingested(address, *options)
    assert [line["after"] for line in said if line["event"] == "reading"] == [3]
    assert [line["feed"] for line in said if "taken for this log" in line["event"]] == [url]
    publish(nats_port, name, [("b", {"x": 1, "y": 1})] * 5, anew=True)
    refused(address, *options)


@pytest.mark.parametrize(("version", "share"), [("3.1.1", ""), ("5", "$share/g/")])
def test_mqtt(client: HullClient, address: str, name: str, version: str, share: str, tmp_path: Path) -> None:
    """An ingest is killed, and the broker restarted: what was sent in the meantime arrives."""
    port = free_port()
    command = mosquitto(tmp_path, port, "persistence true", f"persistence_location {tmp_path}/", "autosave_interval 1")
    moves = [(f"v{i % 10}", [i, -i]) for i in range(150)] + [(f"w{i % 10}", [i, -i]) for i in range(50)]
    url = f"mqtt://127.0.0.1:{port}/{share}fleet/+/position?version={version}"
    options = (url, "--hull", name, "--key", "{1}", "--x", "$[0]", "--y", "$[1]")
    with broker(command, port) as process:
        with ingest_process(address, *options, killed=True) as ingest:
            ingest.wait_for("reading")
            send(port, moves[:100])
            wait_until(lambda: known(client, name))
            assert "after" not in ingest.said("reading")[0], "its messages have no numbers"
            ingest.process.kill()
        send(port, moves[100:150])
        process.terminate()  # saves its sessions
        process.wait(PATIENCE)
    with ingest_process(address, *options) as ingest:
        ingest.wait_for("no messages from the broker, trying again")
        with broker(command, port):
            ingest.wait_for("reading")
            send(port, moves[150:])
            last = dict(moves)
            wait_until(lambda: positions(client, name, list(last)) == {key: tuple(at) for key, at in last.items()})


def known(client: HullClient, hull: str) -> bool:
    try:
        return client.get_hull(hull).info.points == 10
    except HullNotFoundError:
        return False


def send(port: int, moves: Sequence[tuple[str, Sequence[float]]]) -> None:
    """Publish positions; the broker has them when this returns."""
    publisher = Client(CallbackAPIVersion.VERSION2)
    publisher.connect("127.0.0.1", port)
    publisher.loop_start()
    for key, at in moves:
        sent = publisher.publish(f"fleet/{key}/position", json.dumps(at), qos=1)
    sent.wait_for_publish(PATIENCE)
    assert sent.is_published()
    publisher.disconnect()
    publisher.loop_stop()


@pytest.mark.parametrize("scheme", ["mqtt", "nats"])
def test_a_network_to_the_broker_that_swallows_bytes(
    client: HullClient, address: str, name: str, tmp_path: Path, nats_port: int, scheme: str
) -> None:
    port = free_port() if scheme == "mqtt" else nats_port
    with ExitStack() as stack:
        if scheme == "mqtt":
            stack.enter_context(broker(mosquitto(tmp_path, port), port))

        def report(place: list[int]) -> None:
            if scheme == "mqtt":
                send(port, [("a", place)])
            else:
                publish(port, name, [("a", place)])

        report([0, 0])
        way = stack.enter_context(proxy(f"127.0.0.1:{port}"))
        url = f"{scheme}://{way.address}/{name if scheme == 'nats' else 'fleet/+/position'}"
        options = (url, "--hull", name, "--key", "k", "--x", "$[0]", "--y", "$[1]", "--ping-interval", "1s")
        client.create_hull(name, keyed="str")
        ingest = stack.enter_context(ingest_process(address, *options))
        ingest.wait_for("reading")
        report([1, 1])
        wait_until(lambda: client.get_hull(name).vertices.tolist() == [[1, 1]])
        way.silence()
        report([2, 2])
        wait_until(lambda: client.get_hull(name).vertices.tolist() == [[2, 2]])
        assert ingest.said("no messages from the broker, trying again")


@pytest.mark.parametrize("scheme", ["mqtt", "nats", "kafka"])
def test_a_broker_that_is_away(address: str, scheme: str) -> None:
    """Whichever it is: the log says so, and the ingest ends when its patience does."""
    options = (f"{scheme}://127.0.0.1:1/t", "--hull", "h", "--key", "$.id", "--patience", "300ms")
    with ingest_process(address, *options, code=3) as ingest:
        ingest.process.wait(PATIENCE)
        (*said, error, advice) = ingest.lines()
    assert json.loads(said[0])["event"] == "no messages from the broker, trying again"
    assert error.lower().startswith(f"error: no answer from the broker: {scheme}: ")
    assert advice == f"Is it running, is {scheme}://127.0.0.1:1/t right?\n"


def test_a_broker_that_wants_a_password(address: str, tmp_path: Path) -> None:
    port = free_port()
    command = [*nats_server(tmp_path, port), "--user", "u", "--pass", "right"]
    url = f"nats://u:wrong@127.0.0.1:{port}/S"
    with broker(command, port), ingest_process(address, url, "--hull", "h", code=2) as ingest:
        ingest.process.wait(PATIENCE)
        (said,) = ingest.lines()
    assert said.startswith("error: the broker refuses the connection: ")
    assert "wrong" not in said


def test_a_server_that_is_away(name: str, nats_port: int) -> None:
    """The log says which, also where each message has a hull of its own; an interruption is no success."""
    publish(nats_port, name, [(f"v{i}", {"lon": i, "lat": i}) for i in range(3)])
    url = f"nats://127.0.0.1:{nats_port}/{name}/{name}.*"
    options = ("127.0.0.1:1", url, "--hull", f"{name}/{{1}}", "--to-end")
    with ingest_process(*options, "--patience", "300ms", code=3) as ingest:
        ingest.process.wait(PATIENCE)
        assert ingest.said("waiting for the server")[0]["server"] == "127.0.0.1:1"
        assert ingest.lines()[-2].startswith("error: no answer from 127.0.0.1:1: ")
    with ingest_process(*options, "--grace", "100ms", code=130) as ingest:
        ingest.wait_for("waiting for the server")
        ingest.process.send_signal(signal.SIGINT)
        ingest.process.wait(PATIENCE)
        assert ingest.said("stopping when what is under way is done")[0]["messages"] == 3
        assert ingest.lines()[-1].startswith("error: interrupted before the end")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["mqtt://b/t", "--hull", "h"], "Give --key"),
        (["mqtt://b/t", "--hull", "h", "--key", "{1}", "--to-end"], "a subscription of MQTT has no end"),
        (["mqtt://b/t?version=4", "--hull", "h", "--key", "{1}"], "version is '4', not 3.1.1 or 5"),
        (["mqtt://b", "--hull", "h", "--key", "{1}"], "give mqtt://HOST/FILTER"),
        (["nats://b", "--hull", "h"], "give nats://HOST/STREAM"),
        (["kafka://b", "--hull", "h"], "give kafka://HOST:PORT/TOPIC"),
        (["kafka://b/t?partition=first", "--hull", "h"], "partition is 'first', not a number from 0"),
        (["amqp://b/q", "--hull", "h"], "begins with amqp:; there are mqtt(s)://HOST/FILTER"),
        (["127.0.0.1:4222/S", "--hull", "h"], "begins with no scheme; there are mqtt(s)://HOST/FILTER"),
        (["mqtt://b/t/#/p", "--hull", "h", "--key", "{1}"], "the filter 't/#/p': # must be the last level"),
        (["mqtt://b/t/a+", "--hull", "h", "--key", "{1}"], "the filter 't/a+': + must be a whole level"),
        (["mqtt://b/$share/g", "--hull", "h", "--key", "{1}"], "must be $share/GROUP/FILTER"),
        (["mqtt://b/t?verson=5", "--hull", "h", "--key", "{1}"], "no option 'verson' after the question mark: there"),
        (["mqtt://b/t?client_id=", "--hull", "h", "--key", "{1}"], "the option client_id has no value"),
        (["nats://b/s?foo=1", "--hull", "h"], "no option 'foo' after the question mark: there are none"),
        (["nats://b/s/a b", "--hull", "h"], "'a b' is no subject of NATS"),
        (["nats://b/s/>.a", "--hull", "h"], "goes on after >"),
        (["nats://b/s", "--hull", "h", "--producer", "a b"], "--producer 'a b': a name has 1 to 200 letters"),
        (["nats://b/a.b", "--hull", "h"], "no stream of NATS is called 'a.b'"),
        (["nats://b/s", "--hull", "h", "--key", "{1"], "--key '{1': { has no other brace; {1}, {2}, ..."),
        (["nats://b/s", "--hull", "h", "--key", "{tpic}"], "--key: {tpic} is not {topic}, {key}, a path {$.name}"),
        (["nats://b/s", "--hull", "h", "--x", "$.a b"], "' b' at position 4 is no .name, [index] or ['name']"),
        (["nats://b/s", "--hull", "h", "--x", "lon"], "--x 'lon' is the same for all messages"),
        (["nats://b/s", "--hull", "h/{0}"], "--hull: {0} is not {topic}"),
        (["nats://b/s", "--hull", "h", "--each", "points"], "--each 'points' is no path"),
        (["nats://b/s", "--hull", "h", "--tombstones", "delete"], "--tombstones delete is for points with keys"),
        (["kafka://b/s", "--hull", "h", "--tombstones", "delete", "--key", "$.id"], "--key '$.id' is in the message"),
        (["nats://b/s", "--hull", "{$.h}", "--tombstones", "delete", "--key", "{1}"], "--hull '{$.h}' is in the"),
        (["nats://b/s", "--hull", "h", "--report", "soon"], "--report"),
        (["nats://b/s", "--hull", "h", "--patience", "-1s"], "--patience '-1s' is not a time span"),
    ],
)
def test_odd_arguments(arguments: Sequence[str], words: str) -> None:
    ran = dynhull("ingest", *arguments)
    assert ran.exit_code == 2
    assert words in ran.stderr
