"""A server that keeps the past of hulls in an object store: the store hangs, and who does not ask it does not wait."""

import time

import numpy as np
import pytest
from metrics import scrape
from object_store import CREDENTIALS, object_store, place
from patience import wait_until
from proxy import Proxy
from server_process import server_process

from dynhull_client import HullClient

pytestmark = [pytest.mark.long, pytest.mark.only_with("OBJECTS_CASES")]
KEYS = [f"vehicle {i}" for i in range(40)]
BATCHES = 200


def positions(revision):
    return np.round(np.random.default_rng(revision).random((len(KEYS), 2)), 7)


@pytest.fixture
def store(tmp_path, monkeypatch):
    for name, value in CREDENTIALS.items():
        monkeypatch.setenv(name, value)
    with object_store(tmp_path / "store") as address:
        proxy = Proxy(address)
        yield proxy
        proxy.close()


def write(client, batches):
    """How long the longest batch took."""
    longest = 0.0
    for _ in range(batches):
        revision = client.get_hull("fleet").info.revision + 1
        begun = time.monotonic()
        client.put("fleet", KEYS, positions(revision))
        longest = max(longest, time.monotonic() - begun)
    return longest


def test_while_the_store_hangs_writes_go_on_and_the_server_ends_when_told(tmp_path, store):
    options = "--data", str(tmp_path / "data"), "--snapshot-points", "200", "--metrics-port", "0"
    options += "--history-dir", place(store.address, "fleet")
    with server_process(*options, complaints=None) as server, HullClient(server.address) as client:
        metrics = server.process.stdout.readline().split()[-1].removeprefix("http://").removesuffix("/metrics")
        client.create_hull("fleet", keyed="str", history=True)
        wait_until(lambda: write(client, 5) and client.history("fleet").batches > 10)
        filed = client.history("fleet").batches
        np.testing.assert_array_equal(client.at("fleet", 7).positions(KEYS).positions, positions(7))

        store.silence()
        store.flowing.clear()
        assert write(client, BATCHES) < 2.0
        assert client.history("fleet").batches == filed
        wait_until(lambda: scrape(metrics)['dynhull_background_failing_seconds{work="history"}'] > 0)
        last = client.get_hull("fleet").info.revision
        np.testing.assert_array_equal(client.at("fleet", last - 1).positions(KEYS).positions, positions(last - 1))
        assert write(client, 5) < 2.0

        store.flowing.set()
        wait_until(lambda: write(client, 5) and client.history("fleet").batches > filed + BATCHES // 2)
        for revision in (3, filed + 1, last - 20):
            np.testing.assert_array_equal(client.at("fleet", revision).positions(KEYS).positions, positions(revision))
        store.silence()
        store.flowing.clear()
        write(client, 30)
