"""Relay and server are killed: every event arrives, in order, or is a dead letter once."""

import json
import shutil
from itertools import pairwise
from pathlib import Path

from patience import wait_until
from ports import free_port
from receiver import Received, receiver
from relay_process import FAST, acknowledged, fence, pass_through, relay_process
from server_process import run, server_process

from dynhull_client import HullClient

FENCES = ["north", "south"]
PLAIN = ("--unsigned", "--allow-private", *FAST)


def test_every_event_arrives_in_order(tmp_path: Path) -> None:
    kept = ("--data", str(tmp_path / "data"), "--port", str(free_port()))
    with receiver() as endpoint:
        to = ("--to", endpoint.url, *PLAIN)
        with server_process(*kept, killed=True) as server, HullClient(server.address) as client:
            for name in FENCES:
                fence(client, name)
            with relay_process(server.address, tmp_path, *FENCES, *to, killed=True) as relay:
                for name in FENCES:
                    pass_through(client, name, map(str, range(5)))
                wait_until(lambda: all(endpoint.events(name) for name in FENCES))
                endpoint.stop()
                for name in FENCES:
                    pass_through(client, name, map(str, range(5, 10)))
                relay.wait_for("not delivered, trying again")
                relay.process.kill()
            with relay_process(server.address, tmp_path, *FENCES, *to, killed=True) as relay:
                relay.wait_for("not delivered, trying again")
                server.process.kill()
                server.process.wait()
                relay.wait_for("not delivered, trying again")
                relay.process.kill()
        with relay_process(server.address, tmp_path, *FENCES, *to) as relay:
            assert relay.wait_for("waiting for the server")["server"] == server.address
            endpoint.start()
            with server_process(*kept) as again, HullClient(again.address) as client:
                for name in FENCES:
                    pass_through(client, name, map(str, range(10, 15)))
                for name in FENCES:
                    wait_until(lambda name=name: acknowledged(client, name) == 30)
        for name in FENCES:
            found = [event["data"]["sequence"] for event in endpoint.events(name)]
            assert sorted(set(found)) == list(range(1, 31))
            assert all(after <= before + 1 for before, after in pairwise(found)), "none before its predecessor"
            ids = {(event["id"], event["data"]["sequence"]) for event in endpoint.events(name)}
            assert len(ids) == 30


def test_an_event_that_is_refused_again_is_one_dead_letter(tmp_path: Path) -> None:
    """The relay is killed after it has written the dead letters, and before the server knows."""
    data, state = ("--data", str(tmp_path / "data")), ("--state", str(tmp_path / "relay"))
    with receiver() as endpoint:
        to = ("--to", endpoint.url, "--unsigned", "--allow-private")
        with server_process(*data, killed=True) as server, HullClient(server.address) as client:
            fence(client, "depot")
            pass_through(client, "depot", ["truck"])

            def refuse(_: Received) -> tuple[int, dict[str, str]]:
                server.process.kill()
                server.process.wait()
                return 422, {}

            endpoint.answer = refuse
            options = (*to, *FAST, "--attempts", 1, "--batch", 2)
            with relay_process(server.address, tmp_path, "depot", *options, killed=True) as relay:
                relay.wait_for("refused: a dead letter now")
                relay.process.kill()
        endpoint.answer = lambda _: (422, {})
        with (
            server_process(*data) as again,
            HullClient(again.address) as client,
            relay_process(again.address, tmp_path, "depot", *options),
        ):
            wait_until(lambda: acknowledged(client, "depot") == 2)
        listing = ("relay", "dead-letters", "list", *state, "--json")
        listed = [json.loads(line) for line in run(*listing).stdout.splitlines()]
        assert [each["event"]["data"]["sequence"] for each in listed] == [1, 2]

        # As earlier versions kept a second one.
        kept = next((tmp_path / "relay" / "dead-letters").glob("*.json"))
        shutil.copy(kept, kept.with_name(f"01234567890123456789-{kept.name}"))
        assert [json.loads(line)["id"] for line in run(*listing).stdout.splitlines()] == [each["id"] for each in listed]
        endpoint.answer = lambda _: (200, {})
        assert run("relay", "dead-letters", "send", *state, *to).stdout == "2 sent\n"
        assert [event["data"]["sequence"] for event in endpoint.events("depot")] == [1, 2]
        assert run(*listing).stdout == ""
