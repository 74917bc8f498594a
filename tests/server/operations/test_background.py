"""Background work that fails is tried again and counted, and the health check reports it."""

import os
import resource
import sys
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import grpc
import numpy as np
import pytest
from cases import slow
from grpc_health.v1 import health_pb2, health_pb2_grpc
from metrics import scrape
from patience import PATIENCE, wait_until
from server_process import Server, server_process

from dynhull_client import DynhullError, HullClient, OutcomeUnknownError, UnavailableError

FAULTY = str(Path(__file__).parents[2] / "support/faulty_storage.py")
SERVING, NOT_SERVING = health_pb2.HealthCheckResponse.SERVING, health_pb2.HealthCheckResponse.NOT_SERVING


@contextmanager
def faulty_server(folder: Path, *options: str, **expected: object) -> Iterator[tuple[Server, Path]]:
    """A server, and the folder in which a file named after a fault causes that fault."""
    faults = folder / "faults"
    faults.mkdir()
    wrap = [sys.executable, FAULTY, str(faults)]
    with server_process("--data", str(folder / "data"), *options, wrap=wrap, **expected) as server:
        yield server, faults


def health(address: str) -> int:
    with grpc.insecure_channel(address) as channel:
        request = health_pb2.HealthCheckRequest(service="dynhull.v1.HullService")
        return health_pb2_grpc.HealthStub(channel).Check(request).status


@pytest.mark.one_process("faults are put into the process that is started")
def test_work_that_keeps_failing_makes_the_server_unwell_until_it_succeeds(tmp_path: Path) -> None:
    with (
        faulty_server(tmp_path, "--metrics-port", "0", complaints="health is NOT_SERVING") as (server, faults),
        HullClient(server.address) as client,
    ):
        client.create_hull("a")
        metrics = server.process.stdout.readline().split()[-1].removeprefix("http://").removesuffix("/metrics")
        (faults / "checkpoint").touch()
        wait_until(lambda: health(server.address) == NOT_SERVING)
        counted = scrape(metrics)
        assert counted['dynhull_background_failures_total{work="checkpoint"}'] >= 2
        assert counted['dynhull_background_unwell{work="checkpoint"}'] == 1
        assert counted['dynhull_background_failing_seconds{work="checkpoint"}'] > 1
        assert counted['dynhull_background_unwell{work="snapshots"}'] == 0
        assert client.apply("a", insert=[[1, 2]]).revision == 1  # it does what it can
        (faults / "checkpoint").unlink()
        wait_until(lambda: health(server.address) == SERVING)
        assert scrape(metrics)['dynhull_background_unwell{work="checkpoint"}'] == 0


@pytest.mark.one_process("faults are put into the process that is started")
def test_the_log_is_short_again_after_checkpoints_failed(tmp_path: Path) -> None:
    log = tmp_path / "data" / "dynhull.db-wal"
    points = np.random.default_rng(8).normal(size=(50, 2000, 2))
    with (
        faulty_server(tmp_path, complaints="unhealthy: health is NOT_SERVING") as (server, faults),
        HullClient(server.address) as client,
    ):
        client.create_hull("a")
        (faults / "checkpoint").touch()
        wait_until(lambda: health(server.address) == NOT_SERVING)
        for each in points:
            client.apply("a", insert=each)
        assert log.stat().st_size > points.nbytes
        (faults / "checkpoint").unlink()
        wait_until(lambda: client.apply("a", insert=points[0]) and log.stat().st_size <= 2**18)


@pytest.mark.one_process("faults are put into the process that is started")
def test_a_disk_that_hangs_makes_the_server_unwell(tmp_path: Path) -> None:
    with (
        faulty_server(tmp_path, complaints="a commit has been running for") as (server, faults),
        HullClient(server.address) as client,
        ThreadPoolExecutor() as threads,
    ):
        client.create_hull("a")
        (faults / "hang").touch()
        applied = threads.submit(client.apply, "a", insert=[[1, 2]])
        wait_until(lambda: health(server.address) == NOT_SERVING)
        assert not applied.done()
        (faults / "hang").unlink()
        assert applied.result().revision == 1
        wait_until(lambda: health(server.address) == SERVING)


@pytest.mark.one_process("faults are put into the process that is started")
def test_what_should_be_impossible_makes_the_server_unwell_at_once(tmp_path: Path) -> None:
    with faulty_server(tmp_path, complaints="this is a bug") as (server, faults):
        (faults / "impossible").touch()
        wait_until(lambda: health(server.address) == NOT_SERVING)
        (faults / "impossible").unlink()
        wait_until(lambda: health(server.address) == SERVING)


@pytest.mark.one_process("faults are put into the process that is started")
def test_the_process_ends_with_its_committing_thread(tmp_path: Path) -> None:
    died = "background work has died"
    with (
        faulty_server(tmp_path, complaints=died, code=os.EX_SOFTWARE) as (server, faults),
        HullClient(server.address) as client,
    ):
        client.create_hull("a")
        (faults / "thread").touch()
        with pytest.raises(DynhullError):
            client.apply("a", insert=[[1, 2]], timeout=PATIENCE)
        server.process.wait(PATIENCE)


@pytest.mark.one_process("faults are put into the process that is started")
def test_an_outcome_is_unknown_until_the_disk_can_be_read(tmp_path: Path) -> None:
    with (
        faulty_server(tmp_path, complaints="Input/output error") as (server, faults),
        HullClient(server.address, retries=0) as client,
    ):
        client.create_hull("a")
        client.apply("a", insert=[[0, 0]])
        (faults / "settle").touch()
        (faults / "commit").touch()
        with pytest.raises(OutcomeUnknownError, match="whether this was applied, until the storage can be read again"):
            client.apply("a", insert=[[1, 1]])
        with pytest.raises(UnavailableError):
            client.get_hull("a", min_revision=1)
        with pytest.raises(UnavailableError):
            client.apply("a", insert=[[2, 2]])
        (faults / "commit").unlink()
        (faults / "settle").unlink()
        wait_until(lambda: readable(client))
        assert client.count("a", [[0, 0], [1, 1], [2, 2]]).counts.tolist() == [1, 1, 0]  # it had been kept


def readable(client: HullClient) -> bool:
    try:
        client.get_hull("a")
    except UnavailableError:
        return False
    return True


def end(faults: Path) -> None:
    """End the faults of commits, once they have come."""
    wait_until((faults / "settle failed").exists)
    for name in ("commit", "settle"):
        (faults / name).unlink()


@pytest.mark.one_process("faults are put into the process that is started")
def test_a_writer_finds_out_and_goes_on(tmp_path: Path) -> None:
    points = np.random.default_rng(5).normal(size=(30, 4, 2))
    with (
        faulty_server(tmp_path, complaints="Input/output error") as (server, faults),
        HullClient(server.address) as client,
    ):
        client.create_hull("a")
        with client.writer("a", producer="p", batch_points=4, linger=0.0) as writer:
            for i, each in enumerate(points):
                if i == 10:
                    (faults / "settle").touch()
                    (faults / "commit").touch()
                    threading.Thread(target=end, args=(faults,)).start()
                writer.put(insert=each)
        assert client.last_sequence("a", "p") == client.get_hull("a").info.revision
        assert set(client.count("a", points.reshape(-1, 2)).counts.tolist()) == {1}


def test_nothing_is_acknowledged_into_a_folder_that_is_gone(tmp_path: Path) -> None:
    with (
        server_process("--data", str(tmp_path / "data"), complaints="moved or deleted under the server") as server,
        HullClient(server.address, retries=0) as client,
    ):
        client.create_hull("a")
        client.apply("a", insert=[[0, 0]])
        (tmp_path / "data").rename(tmp_path / "away")
        wait_until(lambda: not written(client))
        with pytest.raises(UnavailableError, match="put it back"):
            client.apply("a", insert=[[1, 1]])
        kept = client.get_hull("a").info.revision
        (tmp_path / "away").rename(tmp_path / "data")
        wait_until(lambda: written(client))
        assert client.get_hull("a").info.revision == kept + 1


def written(client: HullClient) -> bool:
    try:
        client.apply("a", insert=[[2, 2]])
    except UnavailableError:
        return False
    return True


@slow
def test_without_descriptors_what_was_acknowledged_stays_and_all_goes_on_afterwards(tmp_path: Path) -> None:
    data = str(tmp_path / "data")
    points = np.random.default_rng(6).normal(size=(600, 5, 2))
    with (
        server_process("--data", data, "--snapshot-points", "1000", killed=True) as server,
        HullClient(server.address) as client,
    ):
        pid = server.process.pid
        before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        client.create_hull("a")
        client.apply("a", insert=points[0])
        used = max(int(each.name) for each in Path(f"/proc/{pid}/fd").iterdir())
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (used, before[1]))
        for i, each in enumerate(points[1:500], start=1):  # more than makes a snapshot due
            client.apply("a", insert=each, producer="p", sequence=i)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)
        for i, each in enumerate(points[500:], start=500):
            client.apply("a", insert=each, producer="p", sequence=i)
        assert health(server.address) == SERVING
        server.process.kill()
    with server_process("--data", data) as server, HullClient(server.address) as client:
        assert client.get_hull("a").info.points == 5 * 600
        assert client.verify("a").equal
