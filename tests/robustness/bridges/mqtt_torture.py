"""A real ingest of a real MQTT broker that is killed again and again.

    python tests/robustness/bridges/mqtt_torture.py [--kills 20] [--seed 0]

SIGKILL hits the broker at any moment while positions are published and read. The ingest must never end, and each time
the broker is back and the ingest reads again, what is published then arrives: a broker that is killed may lose what it
had accepted, but nobody else does.
"""

import argparse
import json
import random
import sys
import tempfile
import threading
from pathlib import Path
from typing import Any

from paho.mqtt.client import Client
from paho.mqtt.enums import CallbackAPIVersion

sys.path.append(str(Path(__file__).parents[2] / "support"))
from brokers import broker, mosquitto
from ingest_process import ingest_process
from patience import PATIENCE, wait_until
from ports import free_port
from server_process import server_process

from dynhull_client import HullClient, HullNotFoundError

HULL, KEY = "tortured", "v"
LONGEST_LIFE = 0.3  # seconds in which positions are published before a kill


def publish_until(over: threading.Event, port: int, begun: threading.Event, number: int) -> None:
    """Publish positions whose x is `number`, one after the other."""
    publisher = Client(CallbackAPIVersion.VERSION2, reconnect_on_failure=False)
    publisher.connect("127.0.0.1", port)
    publisher.loop_start()
    while not over.wait(0.002):
        publisher.publish(f"fleet/{KEY}", json.dumps([number, 0]), qos=1)
        begun.set()
    publisher.loop_stop()


def torture(folder: Path, kills: int, seed: int, version: str) -> None:
    rng = random.Random(seed)
    port = free_port()
    command = mosquitto(folder, port, "persistence true", f"persistence_location {folder}/", "autosave_interval 1")
    url = f"mqtt://127.0.0.1:{port}/fleet/+?version={version}"
    options = (url, "--hull", HULL, "--key", "{1}", "--x", "$[0]", "--y", "$[1]", "--plane")
    with (
        server_process() as server,
        HullClient(server.address) as client,
        ingest_process(server.address, *options) as ingest,
    ):

        def at() -> Any:
            try:
                return client.positions(HULL, [KEY]).positions.tolist()[0][0]
            except HullNotFoundError:
                return None

        for number in range(kills):
            with broker(command, port) as process:
                wait_until(lambda number=number: len(ingest.said("reading")) > number)
                over, begun = threading.Event(), threading.Event()
                publishing = threading.Thread(target=publish_until, args=(over, port, begun, number))
                publishing.start()
                wait_until(lambda number=number: at() == number)
                over.wait(rng.uniform(0, LONGEST_LIFE))
                process.kill()
                process.wait(PATIENCE)
                over.set()
                publishing.join()
            assert ingest.process.poll() is None, "the ingest has ended"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kills", type=int, default=20)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    for version in ("3.1.1", "5"):
        with tempfile.TemporaryDirectory() as folder:
            torture(Path(folder), options.kills, options.seed, version)
        print(f"MQTT {version}: {options.kills} kills, and the ingest went on after each")


if __name__ == "__main__":
    main()
