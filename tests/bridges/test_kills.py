"""Relay and server are killed while the endpoint is down: every event arrives, in order."""

from itertools import pairwise
from pathlib import Path

from patience import wait_until
from receiver import receiver
from relay_process import FAST, acknowledged, fence, pass_through, relay_process
from server_process import server_process

from dynhull_client import HullClient

FENCES = ["north", "south"]
PLAIN = ("--unsigned", "--allow-private", *FAST)


def test_every_event_arrives_in_order(tmp_path: Path) -> None:
    data = ("--data", str(tmp_path / "data"))
    with receiver() as endpoint:
        to = ("--to", endpoint.url, *PLAIN)
        with server_process(*data, killed=True) as server, HullClient(server.address) as client:
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
        port = server.address.rpartition(":")[2]
        with relay_process(server.address, tmp_path, *FENCES, *to) as relay:
            assert relay.wait_for("waiting for the server")["server"] == server.address
            endpoint.start()
            with server_process(*data, "--port", port) as again, HullClient(again.address) as client:
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
