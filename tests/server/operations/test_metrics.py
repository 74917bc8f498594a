"""The metrics of a server: their values, and that Prometheus scrapes and accepts them."""

import json
import re
import socket
import subprocess
import threading
import time
from contextlib import closing
from pathlib import Path
from urllib.parse import urlsplit

import grpc
import pytest
from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp
from metrics import fetch, measured, scrape
from patience import wait_until
from peers import program
from prometheus_client import CollectorRegistry
from server_process import PATIENCE

from dynhull_client import HullClient, PointMissingError, Quarantine
from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub
from dynhull_server.rpc.metrics_page import MOST_CONNECTIONS, MetricsPage

ONE = points_pb2.Points(coordinates=[1, 2])

CONFIG = """
global: {{scrape_interval: 100ms, scrape_timeout: 100ms}}
scrape_configs:
  - job_name: dynhull
    static_configs: [{{targets: ["{target}"]}}]
"""


def work(client: HullClient) -> None:
    client.create_hull("a")
    client.apply("a", insert=[[0, 0], [4, 0], [0, 4], [1, 1]], producer="p", sequence=1)
    client.apply("a", insert=[[0, 0], [4, 0], [0, 4], [1, 1]], producer="p", sequence=1)
    client.apply("a", delete=[[1, 1], [9, 9]], missing="count")
    with client.ingest("a") as stream:
        stream.apply(insert=[[2, 2], [3, 3]])
    with pytest.raises(PointMissingError):
        client.apply("a", delete=[[8, 8]])
    client.verify("a")


def test_what_happened_is_counted() -> None:
    with measured("--scrub-cpu", "0") as (server, address), HullClient(server.address) as client:
        work(client)
        with client.watch("a") as watch:
            next(watch)
            wait_until(lambda: scrape(address)["dynhull_watch_lag_seconds"] == 0)  # the client may be first to know
            samples = scrape(address)
            assert samples["dynhull_watchers"] == 1
        assert samples['dynhull_batches_total{outcome="applied"}'] == 3
        assert samples['dynhull_batches_total{outcome="duplicate"}'] == 1
        assert samples['dynhull_batches_total{outcome="refused"}'] == 1
        assert samples['dynhull_updates_total{operation="insert"}'] == 6
        assert samples['dynhull_updates_total{operation="delete"}'] == 1
        assert samples['dynhull_updates_total{operation="missing"}'] == 1
        assert samples['dynhull_calls_total{code="OK",method="Apply"}'] == 3
        assert samples['dynhull_calls_total{code="FAILED_PRECONDITION",method="Apply"}'] == 1
        assert samples['dynhull_call_duration_seconds_count{method="Apply"}'] == 4
        assert samples["dynhull_batch_duration_seconds_count"] == 4
        assert samples['dynhull_verifications_total{origin="call",outcome="equal"}'] == 1
        assert samples['dynhull_watch_events_total{kind="snapshot"}'] == 1
        assert (samples["dynhull_hulls"], samples["dynhull_points"]) == (1, 5)
        assert samples['dynhull_hull_points{hull="a"}'] == 5
        assert samples['dynhull_hull_vertices{hull="a"}'] == 4


def test_what_becomes_of_keys_is_counted() -> None:
    """By a hull whose clock follows event times; another one, whose clock is the server's, loses a key by itself."""
    by_data = hull_pb2.Window(max_age=Duration(seconds=10), max_points=3, clock=hull_pb2.CLOCK_DATA)
    by_data.max_skew.FromSeconds(3600)
    by_data.ahead = hull_pb2.AHEAD_POLICY_CLAMP
    strings = hull_pb2.IDENTITY_STRING_KEYS
    configs = {
        "data": hull_pb2.HullConfig(identity=strings, window=by_data, ordering=hull_pb2.ORDERING_EVENT_TIME),
        "server": hull_pb2.HullConfig(identity=strings, window=hull_pb2.Window(max_age=Duration(nanos=1_000_000))),
    }
    now = int(time.time())

    def put(name: str, *rows: tuple[str, int], **puts: object) -> None:
        keys = points_pb2.Keys(strings=[key for key, _ in rows])
        xy = points_pb2.Points(coordinates=[float(each) for i in range(len(rows)) for each in (i, i)])
        times = points_pb2.Times(timestamps=[Timestamp(seconds=now + at) for _, at in rows])
        batch = batch_pb2.Batch(puts=batch_pb2.Puts(keys=keys, points=xy, times=times, **puts))
        stub.Apply(pb.ApplyRequest(name=name, batch=batch))

    with measured("--scrub-cpu", "0") as (server, address), grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        for name, config in configs.items():
            stub.CreateHull(pb.CreateHullRequest(name=name, config=config))
        put("data", ("a", -500), ("b", -501), ("late", -520))
        put("data", ("a", -502), ("b", -500))  # the first is stale
        put("data", ("a", -499), ("c", -499), condition=batch_pb2.PUT_CONDITION_IF_PRESENT)  # the second is skipped
        put("data", ("d", -498), ("e", -498))  # b is evicted, as the oldest
        assert scrape(address)["dynhull_entities"] == 3
        assert 498 <= scrape(address)["dynhull_clock_lag_seconds"] < 498 + PATIENCE
        put("data", ("f", 100_000))  # clamped; the others expire
        assert scrape(address)["dynhull_clock_lag_seconds"] == 0
        stub.Apply(pb.ApplyRequest(name="server", batch={"puts": {"keys": {"strings": ["g"]}, "points": ONE}}))
        wait_until(lambda: scrape(address)['dynhull_updates_total{operation="expire"}'] == 4)
        samples = scrape(address)
        assert samples["dynhull_entities"] == 1
        updates = {"insert": 6, "move": 2, "evict": 1, "delete": 0, "missing": 0}
        assert {each: samples[f'dynhull_updates_total{{operation="{each}"}}'] for each in updates} == updates
        rows = {"late": 1, "stale": 1, "skipped": 1, "clamped": 1}
        assert {each: samples[f'dynhull_rows_total{{outcome="{each}"}}'] for each in rows} == rows


def test_the_quarantine_is_counted() -> None:
    with measured() as (server, address), HullClient(server.address) as client:
        client.create_hull("fleet", keyed="int", quarantine=Quarantine(max_growth=1))
        client.put("fleet", [1, 2, 3], [[0, 0], [4, 0], [0, 4]])
        client.put("fleet", [4, 5, 6, 1], [[9, 9], [8, 8], [7, 7], [6, 6]])
        client.release("fleet", [4], drop=[5])
        samples = scrape(address)
    assert samples["dynhull_held_keys"] == 2
    counted = {"held": 4, "released": 1, "dropped": 1}
    assert {each: samples[f'dynhull_quarantine_total{{outcome="{each}"}}'] for each in counted} == counted


@pytest.mark.one_process("each process has a limit of its own")
def test_the_oldest_hulls_under_a_prefix_have_measures() -> None:
    options = ("--metrics-prefix", "fleet/", "--metrics-prefix", "tram/", "--metrics-hulls", "3", "--scrub-cpu", "0")
    left_out = "hulls have no measures on the metrics page: there are more than --metrics-hulls"
    with measured(*options, complaints=left_out) as (server, address), HullClient(server.address) as client:

        def of(name: str) -> dict[str, float]:
            label = f'{{hull="{name}"}}'
            found = {key.removesuffix(label): value for key, value in scrape(address).items() if label in key}
            return {key.removeprefix("dynhull_hull_"): value for key, value in found.items()}

        for name in ("other", "fleet/b", "tram/a"):
            client.create_hull(name)
        client.create_hull("fleet/globe", geographic=True)
        client.create_hull("fleet/a")
        before = time.time()
        client.apply("fleet/b", insert=[[0, 0], [4, 0], [4, 3], [0, 3]])
        client.apply("fleet/globe", insert=[[0, 0], [1, 0], [0, 1]])
        found = of("fleet/b")
        changed = found.pop("changed_timestamp_seconds")
        assert before - 1 < changed < before + PATIENCE
        sizes = {"points": 4, "vertices": 4, "revisions_total": 1}
        assert found == {"area": 12, "perimeter": 14, "diameter": 5, "width": 3, **sizes}
        measures = client.get_hull("fleet/globe").measures
        found = of("fleet/globe")
        units = {"area_square_meters": measures.area, "perimeter_meters": measures.perimeter}
        assert {key: found[key] for key in units} == units
        assert found["diameter_meters"] == measures.diameter
        assert "area" not in found
        assert of("tram/a")["area"] == 0
        sizes_alone = {"points", "vertices"}  # of the largest hulls
        assert of("fleet/a").keys() == of("other").keys() == sizes_alone
        assert scrape(address)["dynhull_metrics_hulls_left_out"] == 1
        client.delete_hull("fleet/b")
        client.create_hull("fleet/b")
        assert "revisions_total" in of("fleet/a")
        assert of("fleet/b").keys() == sizes_alone
        client.delete_hull("tram/a")
        assert not of("tram/a")
        assert of("fleet/b")["revisions_total"] == 0
        assert scrape(address)["dynhull_metrics_hulls_left_out"] == 0


def test_connections_for_which_there_was_no_thread_keep_no_place(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    page = MetricsPage("127.0.0.1", 0, CollectorRegistry(), None, None, pytest.fail)
    address = urlsplit(page.url)
    with closing(page):
        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, "start", refuse)
            for _ in range(MOST_CONNECTIONS + 1):
                with socket.create_connection((address.hostname, address.port), PATIENCE) as connection:
                    assert connection.recv(1) == b""  # it is closed
        assert fetch(page.url) == ""


def test_promtool_has_nothing_to_complain_about() -> None:
    with measured("--metrics-prefix", "") as (server, address), HullClient(server.address) as client:
        work(client)
        text = fetch(f"http://{address}/metrics")
    command = [program("promtool"), "check", "metrics"]
    checked = subprocess.run(command, input=text, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, "", "")


def test_a_real_prometheus_scrapes_it(tmp_path: Path) -> None:
    with measured("--metrics-prefix", "a") as (server, address), HullClient(server.address) as client:
        work(client)
        area = client.get_hull("a").measures.area
        config = tmp_path / "prometheus.yml"
        config.write_text(CONFIG.format(target=address))
        command = [program("prometheus"), f"--config.file={config}", f"--storage.tsdb.path={tmp_path / 'data'}"]
        command.append("--web.listen-address=127.0.0.1:0")
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as prometheus:
            try:
                log, listening = "", None
                while not (listening and "ready to receive web requests" in log):  # in either order
                    log += prometheus.stderr.readline()
                    listening = re.search(r'msg="Listening on" address=(\S+)', log)
                api = listening[1]
                found: dict[str, float] = {}

                def has_scraped() -> bool:
                    answer = json.loads(fetch(f"http://{api}/api/v1/query?query=%7Bjob%3D%22dynhull%22%7D"))
                    for each in answer["data"]["result"]:
                        found[each["metric"]["__name__"]] = float(each["value"][1])
                    return found.get("dynhull_points") == 5

                wait_until(has_scraped)
                assert found["up"] == 1
                assert found["dynhull_hulls"] == 1
                assert found["dynhull_hull_area"] == area
            finally:
                prometheus.terminate()


def test_the_scrub_compares_every_hull() -> None:
    options = ("--scrub-cpu", "1", "--scrub-pause", "0.01")
    with measured(*options) as (server, address), HullClient(server.address) as client:
        for name in ("a", "b"):
            client.create_hull(name)
            client.apply(name, insert=[[0, 0], [4, 0], [0, 4]])
        equal = 'dynhull_verifications_total{origin="scrub",outcome="equal"}'
        different = 'dynhull_verifications_total{origin="scrub",outcome="different"}'
        while (samples := scrape(address))[equal] < 2:
            assert samples[different] == 0
        assert samples["dynhull_scrub_cpu_seconds_total"] > 0
