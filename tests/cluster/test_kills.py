"""Processes that are killed: what goes on, what comes back, and what is refused."""

import os
import resource
import signal
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import pytest
from cases import slow, with_all_cases
from client_kinds import CLIENTS
from cluster import descendants, processes, runs
from command_line import dynhull
from forked import COMMAND
from grpc_health.v1 import health_pb2, health_pb2_grpc
from logged_process import logged_process
from patience import PATIENCE, wait_until
from server_process import Server, run, server_process
from steady_callers import AsyncPipes, Consumes, Plain, PlainOverShards

from dynhull_client import HullClient, UnavailableError
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

WORKERS = ("--workers", "2", "--gateways", "2")
NAMES = ("north/a", "fleet/a")  # of the workers 0 and 1


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("data")
    options = (*WORKERS, "--data", str(folder))
    with server_process(*options, wrap=["env"], complaints="is started again") as server:  # started as it is for users
        with HullClient(server.address) as client:
            for name in NAMES:
                client.create_hull(name)
        yield server
        # The tests may run in several processes: each of their servers has something to complain about.
        wait_until(lambda: "gateway-1" in processes(server.process.pid))
        gateway = processes(server.process.pid)["gateway-1"]
        # Nothing depends on the process that forks the others: there is another one for those to come, and all end.
        os.kill(forking(server), signal.SIGKILL)
        os.kill(gateway, signal.SIGKILL)
        again("gateway-1", server, gateway)


def forking(server: Server) -> int:
    """The number of the process that forks the others."""
    commands = {each: Path(f"/proc/{each}/cmdline").read_bytes() for each in descendants(server.process.pid)}
    others = processes(server.process.pid).values()
    return next(each for each, command in commands.items() if b"forkserver" in command and each not in others)


def again(name: str, server: Server, killed: int) -> None:
    """Wait until a process is there again, as another one."""
    wait_until(lambda: processes(server.process.pid).get(name, killed) != killed)


@slow
@pytest.mark.parametrize("connect", CLIENTS.values(), ids=CLIENTS)
def test_reads_of_a_pipeline_wait_for_a_killed_worker_and_stay_in_order(
    server: Server, connect: type[HullClient]
) -> None:
    worker = processes(server.process.pid)["worker-0"]
    with connect(server.address, retries=1000) as client, client.pipeline(batch_reads=4) as pipeline:
        asked = [pipeline.get_hull(name) for name in NAMES * 10]
        os.kill(worker, signal.SIGKILL)
        asked += [pipeline.get_hull(name) for name in NAMES * 10]
        client.apply(NAMES[1], insert=[[0, 0]])
        asked += [pipeline.get_hull(name) for name in NAMES * 10]
        found = [each.result() for each in asked]
        assert [each.info.name for each in found] == list(NAMES * 30)
        for first in range(2):
            revisions = [each.revision for each in found[first::2]]
            assert revisions == sorted(revisions)
    again("worker-0", server, worker)


def test_a_killed_worker_comes_back_and_the_others_go_on(server: Server) -> None:
    with HullClient(server.address) as client:
        worker = processes(server.process.pid)["worker-0"]
        before, revision = (client.get_hull(name).revision for name in NAMES[:2])
        with client.writer(NAMES[0], batch_points=1) as writer:
            written: list[Any] = []
            for i in range(200):
                written.append(writer.put([[i, i * i]]))
                if i == 100:
                    written[50].result(PATIENCE)
                    os.kill(worker, signal.SIGKILL)
                if i > 100:
                    client.apply(NAMES[1], insert=[[i, 1]])  # not once refused
        again("worker-0", server, worker)
        assert client.get_hull(NAMES[0]).info.points == client.get_hull(NAMES[0]).revision == before + 200
        assert client.verify(NAMES[0]).equal
        assert client.get_hull(NAMES[1]).revision == revision + 99


def test_the_health_of_a_worker_that_is_away(server: Server) -> None:
    with grpc.insecure_channel(server.address) as channel:
        health = health_pb2_grpc.HealthStub(channel)
        worker = processes(server.process.pid)["worker-1"]
        watch = health.Watch(health_pb2.HealthCheckRequest(service="dynhull.v1.worker/1"), timeout=PATIENCE)
        states = (response.status for response in watch)
        assert next(states) == health_pb2.HealthCheckResponse.SERVING
        os.kill(worker, signal.SIGKILL)
        assert next(states) == health_pb2.HealthCheckResponse.NOT_SERVING
        assert next(states) == health_pb2.HealthCheckResponse.SERVING
        assert health.Check(health_pb2.HealthCheckRequest()).status == health_pb2.HealthCheckResponse.SERVING
        watch.cancel()


def test_a_killed_gateway_costs_its_connections_alone(server: Server) -> None:
    """Each client has one connection. Those of the other gateway do not see anything."""
    options = [("grpc.use_local_subchannel_pool", 1)]
    channels = [grpc.insecure_channel(server.address, options=options) for _ in range(12)]
    watches = []
    for channel in channels:
        watch = HullServiceStub(channel).Watch(pb.WatchRequest(name=NAMES[0]), timeout=PATIENCE)
        next(watch)
        watches.append(watch)
    gateway = processes(server.process.pid)["gateway-0"]
    os.kill(gateway, signal.SIGKILL)
    again("gateway-0", server, gateway)
    with HullClient(server.address) as client:
        wait_until(lambda: reaches(client))
        client.apply(NAMES[0], insert=[[-1, -1]])
    assert "event" in {outcome(watch) for watch in watches} <= {"event", grpc.StatusCode.UNAVAILABLE}
    for channel in channels:
        channel.close()


def outcome(watch: Any) -> Any:
    """How a watch goes on: with an event, or with the code of its end."""
    try:
        next(watch)
    except grpc.RpcError as error:
        return error.code()
    watch.cancel()
    return "event"


def reaches(client: HullClient) -> bool:
    try:
        client.get_hull(NAMES[0])
    except UnavailableError:
        return False
    return True


@slow
def test_a_supervisor_without_descriptors_starts_a_process_once_there_are_some(server: Server) -> None:
    supervisor = server.process.pid
    before = resource.prlimit(supervisor, resource.RLIMIT_NOFILE)
    worker = processes(supervisor)["worker-0"]
    with HullClient(server.address) as client:
        resource.prlimit(supervisor, resource.RLIMIT_NOFILE, (3, before[1]))
        os.kill(worker, signal.SIGKILL)
        wait_until(lambda: "worker-0" not in processes(supervisor))
        for _ in range(50):  # the others go on, while it tries
            client.get_hull(NAMES[1])
        resource.prlimit(supervisor, resource.RLIMIT_NOFILE, before)
        again("worker-0", server, worker)
        wait_until(lambda: reaches(client))


@slow
def test_all_processes_are_restarted_one_at_a_time(server: Server) -> None:
    before = processes(server.process.pid)
    with HullClient(server.address) as client:
        points = client.get_hull(NAMES[0]).info.points
        with client.writer(NAMES[0], batch_points=1) as writer:
            written = 0
            server.process.send_signal(signal.SIGHUP)
            while not processes(server.process.pid).items().isdisjoint(before.items()) or written < 50:
                writer.put([[written, -written]]).result(PATIENCE)
                written += 1
        wait_until(lambda: processes(server.process.pid).keys() == before.keys())
        wait_until(lambda: reaches(client))
        assert client.get_hull(NAMES[0]).info.points == points + written


@slow
def test_callers_notice_no_restart_even_of_the_only_gateway(tmp_path: Path) -> None:
    options = ("--workers", "2", "--gateways", "1", "--data", str(tmp_path))
    with server_process(*options) as server:
        callers = [kind(server.address) for kind in (Plain, PlainOverShards, Consumes, AsyncPipes)]
        for caller in callers:
            caller.begin()
        for _ in range(2):
            before = processes(server.process.pid)
            server.process.send_signal(signal.SIGHUP)
            wait_until(lambda before=before: processes(server.process.pid).items().isdisjoint(before.items()))
            wait_until(lambda before=before: processes(server.process.pid).keys() == before.keys())
        for caller in callers:
            caller.finish()
            assert caller.errors == []


@slow
@with_all_cases  # the gateway is killed after ten seconds
def test_a_gateway_that_hangs_while_it_is_replaced_ends_with_the_server() -> None:
    options = ("--workers", "1", "--gateways", "1", "--grace", "0")
    with server_process(*options, complaints="does not end: it is killed") as server:
        gateway = processes(server.process.pid)["gateway-0"]
        os.kill(gateway, signal.SIGSTOP)
        server.process.send_signal(signal.SIGHUP)
        wait_until(lambda: is_pending(signal.SIGTERM, gateway))  # its heir serves
    assert not runs(gateway)


def is_pending(number: int, process: int) -> bool:
    """Whether a process has been sent a signal that it has not taken."""
    status = Path(f"/proc/{process}/status").read_text()
    (pending,) = (line.split()[1] for line in status.splitlines() if line.startswith("ShdPnd"))
    return bool(int(pending, 16) & 1 << (number - 1))


@slow
def test_signals_during_a_restart_make_one_more() -> None:
    command = [COMMAND, "serve", "--port", "0", *WORKERS, "--in-memory", "--log-format", "json"]
    with logged_process(command) as server:
        assert server.process.stdout is not None
        server.process.stdout.readline()
        server.process.send_signal(signal.SIGHUP)
        for number in range(1, 4):
            wait_until(lambda number=number: len(server.said("a process is restarted")) >= number)
            server.process.send_signal(signal.SIGHUP)
        wait_until(lambda: len(server.said("all processes are restarted")) == 2)
        server.process.terminate()
        server.process.wait(PATIENCE)
        assert len(server.said("a process is restarted")) == 2 * 4


def test_reads_of_one_call_go_on_after_their_worker_was_away(server: Server) -> None:
    """The first ones after it is back, too, if there were none meanwhile."""
    more, answered = threading.Semaphore(0), threading.Event()

    def requests() -> Iterator[pb.QueryRequest]:
        while True:
            reads = [pb.Read(get_hull=pb.GetHullRequest(name=name)) for name in NAMES]
            yield pb.QueryRequest(reads=reads)
            answered.wait(PATIENCE)
            if not more.acquire(timeout=PATIENCE):
                return

    with HullClient(server.address) as client, grpc.insecure_channel(server.address) as channel:
        query = HullServiceStub(channel).Query(requests(), timeout=PATIENCE)
        answers = (answer for response in query for answer in response.answers)
        assert [next(answers).WhichOneof("answer") for _ in NAMES] == ["get_hull"] * 2
        answered.set()
        worker = processes(server.process.pid)["worker-0"]
        os.kill(worker, signal.SIGKILL)
        again("worker-0", server, worker)
        wait_until(lambda: reaches(client))
        more.release()
        assert [next(answers).WhichOneof("answer") for _ in NAMES] == ["get_hull"] * 2
        query.cancel()


def test_a_killed_supervisor_takes_all_along_and_the_folder_is_served_again(tmp_path: Path) -> None:
    data = str(tmp_path / "data")
    with (
        server_process(*WORKERS, "--data", data, killed=True) as server,
        HullClient(server.address) as client,
    ):
        for name in NAMES:
            client.create_hull(name)
            client.apply(name, insert=np.eye(2))
        there = processes(server.process.pid)
        assert set(there) == {"worker-0", "worker-1", "gateway-0", "gateway-1"}
        server.process.kill()
        server.process.wait(PATIENCE)
        wait_until(lambda: not any(Path(f"/proc/{each}/fd").exists() for each in there.values()))
    other = "is divided among 2 workers: start the server with --workers 2"
    assert other in refused("--workers", "3", "--data", data)
    assert other in refused("--data", data)
    checked = dynhull("check", data).stdout
    assert all(f"worker-{i}: 1 hull, all whole" in checked for i in range(2))
    copy = tmp_path / "copy"
    assert dynhull("backup", copy, "--data", data).exit_code == 0
    assert dynhull("export", NAMES[1], tmp_path / "points.csv", "--data", copy).exit_code == 0
    with server_process(*WORKERS, "--data", data) as server, HullClient(server.address) as client:
        assert {each.name: each.points for each in client.list_hulls()} == dict.fromkeys(NAMES, 2)
    (copy / "worker-1" / "dynhull.db").unlink()
    assert "worker-1/dynhull.db is missing: restore a backup" in refused(*WORKERS, "--data", copy)
    manifest = copy / "workers.json"
    manifest.write_text(manifest.read_text().replace('"workers": 2', '"workers": 3'))
    assert "workers.json is damaged: restore a backup" in refused("--workers", "3", "--data", copy)
    assert "is the folder of a server of one process" in refused(*WORKERS, "--data", copy / "worker-0")


@slow
def test_a_worker_that_is_refused_at_its_start_says_why_and_all_end(tmp_path: Path) -> None:
    with server_process(*WORKERS, "--data", str(tmp_path)):
        pass
    (tmp_path / "worker-1" / "dynhull.db").write_bytes(b"no database " * 1000)
    result = run("serve", "--port", "0", *WORKERS, "--data", tmp_path)
    assert (result.returncode, result.stdout) == (1, "")
    assert "cannot serve: " in result.stderr
    assert "worker-1/dynhull.db" in result.stderr
    assert "Traceback" not in result.stderr


def refused(*options: object) -> str:
    result = dynhull("serve", "--port", "0", *options)
    assert result.exit_code
    return result.stderr
