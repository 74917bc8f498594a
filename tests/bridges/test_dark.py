"""The network between a relay and its server stops carrying bytes: the relay says so, and delivers all events."""

from pathlib import Path

from patience import wait_until
from proxy import proxy
from relay_process import fence, pass_through, relay_process
from server_process import server_process

from dynhull_client import HullClient


def test_a_relay_says_so_and_delivers_what_it_has_missed(tmp_path: Path) -> None:
    letters = tmp_path / "letters"
    with server_process("--min-ping-interval", "0.001") as server, HullClient(server.address) as client:
        fence(client, "yard")
        with (
            proxy(server.address) as way,
            relay_process(way.address, tmp_path, "yard", "--to", letters, "--ping-interval", "400ms") as relay,
        ):
            pass_through(client, "yard", ["before"])
            wait_until(lambda: letters.exists() and letters.read_text().count("\n") == 2)
            way.server = ""
            way.silence()
            pass_through(client, "yard", ["meanwhile"])
            relay.wait_for("the server is lost: no events until it is back")
            way.server = server.address
            assert relay.wait_for("the server is back")["seconds"] > 0
            wait_until(lambda: letters.read_text().count("\n") == 4)
