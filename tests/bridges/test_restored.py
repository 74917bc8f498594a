"""Bridges beside a server whose folder is replaced by a backup."""

import asyncio
import json
from pathlib import Path

import nats
from brokers import broker, nats_server
from command_line import dynhull
from ingest_process import ingest_process, ingested
from mortal_server import MortalServer
from patience import PATIENCE, wait_until
from ports import free_port

from dynhull_client import HullClient


def publish(port: int, first: int, last: int) -> None:
    """Publish messages, each of which is a point."""

    async def run() -> None:
        async with await nats.connect(f"nats://127.0.0.1:{port}") as connection:
            context = connection.jetstream()
            await context.add_stream(name="log", subjects=["log.>"])
            for number in range(first, last + 1):
                await context.publish("log.p", json.dumps({"x": number, "y": number**2}).encode())

    asyncio.run(run())


def test_an_ingest_ends_and_the_next_one_takes_what_the_backup_lacks(tmp_path: Path) -> None:
    """Messages between the backup and the restore are not passed over, whatever has been taken since."""
    server, port = MortalServer(tmp_path), free_port()
    try:
        options = f"nats://127.0.0.1:{port}/log", "--hull", "taken", "--x", "$.x", "--y", "$.y"
        with broker(nats_server(tmp_path / "broker", port), port), HullClient(server.address) as client:

            def has(points: int) -> None:
                wait_until(lambda: client.get_hull("taken", timeout=PATIENCE).info.points == points)

            publish(port, 1, 2)
            with ingest_process(server.address, *options, code=1) as ingest:
                wait_until(lambda: ingest.said("reading"))
                wait_until(lambda: [each for each in client.list_hulls() if each.points == 2])
                assert dynhull("backup", tmp_path / "backup", "--data", tmp_path / "data").exit_code == 0
                publish(port, 3, 4)
                has(4)
                server.kill()
                (tmp_path / "data").rename(tmp_path / "lost")
                assert dynhull("restore", tmp_path / "backup", "--data", tmp_path / "data").exit_code == 0
                publish(port, 5, 6)
                server.start()
                assert ingest.process.wait(PATIENCE) == 1
                assert "restored from a backup" in ingest.lines()[-1]
                assert "Start the ingest again: it reads what comes after that" in ingest.lines()[-1]
            has(2)
            assert ingested(server.address, *options)[-1]["points"] == 4
            has(6)
    finally:
        server.kill()
