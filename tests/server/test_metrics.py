"""The metrics of a server: their values, and that Prometheus scrapes and accepts them."""

import json
import re
import subprocess
from pathlib import Path

import pytest
from metrics import fetch, measured, scrape
from peers import program
from server_process import PATIENCE

from dynhull_client import HullClient, PointMissingError

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
            samples = scrape(address)
            assert samples["dynhull_watchers"] == 1
            assert samples["dynhull_watch_lag_seconds"] == 0
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


def test_promtool_has_nothing_to_complain_about() -> None:
    with measured() as (server, address), HullClient(server.address) as client:
        work(client)
        text = fetch(f"http://{address}/metrics")
    command = [program("promtool"), "check", "metrics"]
    checked = subprocess.run(command, input=text, capture_output=True, text=True, timeout=PATIENCE, check=False)
    assert (checked.returncode, checked.stdout, checked.stderr) == (0, "", "")


def test_a_real_prometheus_scrapes_it(tmp_path: Path) -> None:
    with measured() as (server, address), HullClient(server.address) as client:
        work(client)
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
                found = {}
                while found.get("dynhull_points") != 5:
                    answer = json.loads(fetch(f"http://{api}/api/v1/query?query=%7Bjob%3D%22dynhull%22%7D"))
                    found = {each["metric"]["__name__"]: float(each["value"][1]) for each in answer["data"]["result"]}
                assert found["up"] == 1
                assert found["dynhull_hulls"] == 1
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
