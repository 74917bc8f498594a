"""Bridges beside a server whose folder is replaced by a backup."""

import asyncio
import json
from contextlib import ExitStack
from pathlib import Path

import nats
from brokers import broker, nats_server
from cases import slow
from command_line import dynhull
from ingest_process import ingest_process, ingested
from mortal_server import MortalServer
from patience import PATIENCE, wait_until
from ports import free_port
from relay_process import FAST, acknowledged, fence, relay_process

from dynhull_client import HullClient


def publish(port: int, first: int, last: int) -> None:
    """Publish messages, each of which puts a key of its own into the fence."""

    async def run() -> None:
        async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
            context = connection.jetstream()
            await context.add_stream(name="log", subjects=["log.>"])
            for number in range(first, last + 1):
                await context.publish("log.p", json.dumps({"id": f"p{number}", "lon": 1, "lat": 1}).encode())

    asyncio.run(run())


@slow
def test_nothing_is_passed_over_after_a_restore(tmp_path: Path) -> None:
    """The ingest ends, and the next one takes what the backup lacks; the relay tells who is inside, and all since."""
    server, port, file = MortalServer(tmp_path), free_port(), tmp_path / "events"
    options = f"nats://127.0.0.1:{port}/log", "--hull", "fleet", "--key", "$.id"

    def delivered() -> list[tuple[str, str, int]]:
        lines = [json.loads(line) for line in file.read_text().splitlines()]
        return [(line["type"].rpartition(".")[2], line["id"].split("-")[0], line["data"]["sequence"]) for line in lines]

    with ExitStack() as stack:
        stack.callback(server.kill)
        stack.enter_context(broker(nats_server(tmp_path / "broker", port), port))
        client = stack.enter_context(HullClient(server.address))
        fence(client, "fleet")
        stack.enter_context(relay_process(server.address, tmp_path, "fleet", "--to", file, *FAST))
        publish(port, 1, 2)
        with ingest_process(server.address, *options, code=1) as ingest:
            wait_until(lambda: acknowledged(client, "fleet") == 2)
            assert dynhull("backup", tmp_path / "backup", "--data", tmp_path / "data").exit_code == 0
            publish(port, 3, 4)
            wait_until(lambda: acknowledged(client, "fleet") == 4)
            server.kill()
            (tmp_path / "data").rename(tmp_path / "lost")
            assert dynhull("restore", tmp_path / "backup", "--data", tmp_path / "data").exit_code == 0
            server.start()
            publish(port, 5, 6)
            assert ingest.process.wait(PATIENCE) == 1
            assert "restored from a backup" in ingest.lines()[-1]
            assert "Start the ingest again: it reads what comes after that" in ingest.lines()[-1]
        assert ingested(server.address, *options)[-1]["points"] == 4
        assert client.get_hull("fleet").info.points == 6
        wait_until(lambda: acknowledged(client, "fleet") == 8)
    before, after = delivered()[:4], delivered()[4:]
    assert [(kind, sequence) for kind, _, sequence in before] == [("enter", number) for number in range(1, 5)]
    assert [(kind, sequence) for kind, _, sequence in after] == [
        ("lost", 3),
        ("snapshot", 4),
        *(("enter", number) for number in range(5, 9)),
    ]
    assert {uid for _, uid, _ in before}.isdisjoint(uid for _, uid, _ in after)
