"""Callers without permission cost the server little, and no caller can use all of its resources."""

import hashlib
import json
import re
import socket
import ssl
import sys
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import grpc
import numpy as np
import pytest
import trustme
from cases import slow
from cluster import descendants, processes
from command_line import dynhull
from grpc_health.v1 import health_pb2, health_pb2_grpc
from metrics import PROCESS, measured, scrape
from patience import PATIENCE, wait_until
from refusal import refusal
from server_process import Server, finished, server_process

from dynhull_client import HullClient
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

FLOOD = str(Path(__file__).parents[2] / "support/flood.py")
CALLS, BYTES = 48, 4 * 2**20
MOST_BYTES = 100 * 10**6
SERVICE = "/dynhull.v1.HullService/"
POINT = {"inserts": {"coordinates": [1, 2]}}

needs_proc = pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads memory use from /proc")


class Tokens:
    """A file of tokens, each with the prefixes that it may read and write; replaced in one step."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "tokens.toml"

    def write(self, **tokens: tuple[list[str], list[str]]) -> None:
        entries = [
            f'[[token]]\nname = "{token}"\nsha256 = "{hashlib.sha256(token.encode()).hexdigest()}"\n'
            f"read = {read}\nwrite = {write}\n"
            for token, (read, write) in tokens.items()
        ]
        new = self.path.with_name("new")
        new.write_text("".join(entries))
        new.rename(self.path)


ALL = ([""], [""])


@pytest.fixture
def tokens(tmp_path: Path) -> Tokens:
    tokens = Tokens(tmp_path)
    tokens.write(one=ALL, two=ALL)
    return tokens


@pytest.fixture
def guarded(tokens: Tokens) -> Iterator[Server]:
    with server_process("--tokens", str(tokens.path), "--log-level", "error", "--create-on-write") as server:
        yield server


def stub(stack: ExitStack, server: Server, token: str) -> Callable[..., object]:
    """The method of that name, with the token."""
    channel = stack.enter_context(grpc.insecure_channel(server.address))
    plain = HullServiceStub(channel)
    metadata = [("authorization", f"Bearer {token}")]
    return lambda method, request: getattr(plain, method)(request, metadata=metadata)


@pytest.fixture(scope="module")
def flooded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    tokens = Tokens(tmp_path_factory.mktemp("tokens"))
    tokens.write(one=ALL)
    with server_process("--tokens", str(tokens.path), "--log-level", "error") as server:
        yield server


@slow
@needs_proc
@pytest.mark.every(2)
@pytest.mark.parametrize("token", ["", "wrong"])
@pytest.mark.parametrize(
    "method",
    [
        f"{SERVICE}Apply",
        f"{SERVICE}Ingest",
        f"{SERVICE}Stream",
        f"{SERVICE}Watch",
        "/grpc.health.v1.Health/Check",
        "/grpc.health.v1.Health/Watch",
        "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
    ],
)
def test_messages_of_strangers_take_no_memory(flooded: Server, method: str, token: str) -> None:
    every = [Path(f"/proc/{each}") for each in (flooded.process.pid, *descendants(flooded.process.pid))]

    def memory(what: str) -> int:
        texts = [(each / "status").read_text() for each in every]
        return sum(int(re.search(rf"{what}:\s+(\d+) kB", text).group(1)) for text in texts) * 1024

    for each in every:
        (each / "clear_refs").write_text("5")  # forget the peak so far
    before = memory("VmRSS")
    command = [sys.executable, FLOOD, flooded.address, token, method, str(CALLS), str(BYTES)]
    ended = finished(command)
    refused = "RESOURCE_EXHAUSTED" if "health" in method else "UNAUTHENTICATED"
    assert json.loads(ended.stdout) == {refused: CALLS}
    assert memory("VmHWM") - before < MOST_BYTES


def test_a_token_taken_away_ends_its_calls(guarded: Server, tokens: Tokens) -> None:
    """The server notices by itself, without a call in between."""
    with ExitStack() as stack:
        one, two = (stub(stack, guarded, token) for token in ("one", "two"))
        one("CreateHull", pb.CreateHullRequest(name="a"))
        watches = [each("Watch", pb.WatchRequest(name="a")) for each in (one, two)]
        for watch in watches:
            next(watch)

        def requests(kind: type) -> Iterator[object]:
            yield kind(name="a", batch=POINT)
            yield from iter(lambda: ended.wait(PATIENCE), True)

        ended = threading.Event()
        stream = one("Stream", requests(pb.StreamRequest))
        assert next(stream).result.revision == 1
        channel = stack.enter_context(grpc.insecure_channel(guarded.address))
        metadata = [("authorization", "Bearer one")]
        plain = HullServiceStub(channel)
        ingest = plain.Ingest.future(requests(pb.IngestRequest), metadata=metadata)
        wait = plain.GetHull.future(pb.GetHullRequest(name="a", min_revision=1000), metadata=metadata)
        assert next(event for event in watches[1] if event.revision == 2)  # the stream's batch and the ingest's
        tokens.write(two=ALL)
        for end in (lambda: list(stream), lambda: list(watches[0]), ingest.result, wait.result):
            code, info, _ = refusal(end)
            assert (code, info.reason) == (grpc.StatusCode.UNAUTHENTICATED, "UNAUTHENTICATED")
        ended.set()
        kept = two("GetHull", pb.GetHullRequest(name="a")).hull
        assert kept.revision == kept.point_count == 2
        two("Apply", pb.ApplyRequest(name="a", batch=POINT))
        assert next(event for event in watches[1] if event.revision == 3)
        watches[1].cancel()


def test_a_token_narrowed_ends_what_it_no_longer_allows(guarded: Server, tokens: Tokens) -> None:
    with ExitStack() as stack:
        one, two = (stub(stack, guarded, token) for token in ("one", "two"))
        for name in ("a", "b"):
            two("CreateHull", pb.CreateHullRequest(name=name))
        watches = {name: one("Watch", pb.WatchRequest(name=name)) for name in ("a", "b")}
        for watch in watches.values():
            next(watch)
        tokens.write(one=(["b"], []), two=ALL)
        code, info, _ = refusal(lambda: list(watches["a"]))
        assert code == grpc.StatusCode.PERMISSION_DENIED
        assert (info.reason, dict(info.metadata)) == ("PERMISSION_DENIED", {"scope": "read", "value": "a"})
        two("Apply", pb.ApplyRequest(name="b", batch=POINT))
        assert next(watches["b"]).revision == 1
        assert refusal(lambda: one("Apply", pb.ApplyRequest(name="b", batch=POINT)))[1].reason == "PERMISSION_DENIED"
        watches["b"].cancel()


def test_a_watcher_that_does_not_read_is_ended_too(tokens: Tokens) -> None:
    """Its first event is larger than the send buffer: it receives that event whole, and then the refusal."""
    x = np.arange(300_000.0)
    parabola = np.column_stack([x, x * x]).astype("<f8")
    options = ("--tokens", str(tokens.path), "--log-level", "error", "--create-on-write")
    with measured(*options) as (server, metrics), ExitStack() as stack:
        two = stub(stack, server, "two")
        two("Apply", pb.ApplyRequest(name="a", batch={"inserts": {"packed": parabola.tobytes()}}))
        # With a window that grows, the client takes in all of the event before anybody reads it.
        large = [("grpc.max_receive_message_length", -1), ("grpc.http2.bdp_probe", 0)]
        unread = HullServiceStub(stack.enter_context(grpc.insecure_channel(server.address, options=large)))
        watch = unread.Watch(pb.WatchRequest(name="a"), metadata=[("authorization", "Bearer one")])
        wait_until(lambda: scrape(metrics)["dynhull_watch_lag_seconds"] > 0)
        tokens.write(two=ALL)
        wait_until(lambda: scrape(metrics)["dynhull_watchers"] == 0)
        read = []
        code, info, _ = refusal(lambda: read.extend(watch))
        assert (code, info.reason) == (grpc.StatusCode.UNAUTHENTICATED, "UNAUTHENTICATED")
        assert [len(event.snapshot.vertices.packed) for event in read] == [parabola.nbytes]


def test_a_missing_file_of_tokens_is_told_once(tokens: Tokens, tmp_path: Path) -> None:
    with (
        logged(tmp_path, "--tokens", str(tokens.path)) as (server, log),
        HullClient(server.address, token="one") as one,
    ):
        one.create_hull("a")
        tokens.path.unlink()
        for _ in range(20):
            assert one.get_hull("a").info.name == "a"
        tokens.write(two=ALL)
        wait_until(lambda: refusal_of(lambda: one.get_hull("a")))
        readers = len(processes(server.process.pid)) or 1
    assert 1 <= log.read_text().count("the tokens do not change") <= readers


def refusal_of(call: Callable[[], object]) -> Exception | None:
    try:
        call()
    except Exception as error:
        return error
    return None


@contextmanager
def logged(folder: Path, *options: str) -> Iterator[tuple[Server, Path]]:
    """A server, and the file of its log."""
    log = folder / "log"
    wrap = ("sh", "-c", f'exec "$0" "$@" 2>{log}')
    with server_process(*options, wrap=wrap) as server:
        yield server, log


@slow
def test_refusals_do_not_fill_the_log_and_are_all_counted(tokens: Tokens, tmp_path: Path) -> None:
    calls, at_once = 1_000, 500  # of a thousand that wait to be looked at gRPC itself cancels some
    options = ("--tokens", str(tokens.path), "--log-format", "json", "--metrics-port", "0")
    with logged(tmp_path, *options) as (server, log):
        metrics = server.process.stdout.readline().split("//")[1].split("/")[0]
        with grpc.insecure_channel(server.address) as channel:
            locate = HullServiceStub(channel).Locate
            for _ in range(0, calls, at_once):
                begun = [locate.future(pb.LocateRequest(name="a")) for _ in range(at_once)]
                assert {call.code() for call in begun} == {grpc.StatusCode.UNAUTHENTICATED}
        counted = 'dynhull_calls_total{code="UNAUTHENTICATED",method="Locate"}'
        wait_until(lambda: scrape(metrics).get(counted) == calls)
    lines = [json.loads(line) for line in log.read_text().splitlines()]
    assert sum(line.get("left_out", 1) for line in lines) == calls
    assert len(lines) < calls / 10


def test_methods_that_there_are_not_are_refused_like_others(tokens: Tokens) -> None:
    with measured("--tokens", str(tokens.path), "--log-level", "error") as (server, metrics):
        with grpc.insecure_channel(server.address) as channel:
            call = channel.unary_unary("/dynhull.v1.HullService/Nothing")
            assert refusal(lambda: call(b""))[1].reason == "UNAUTHENTICATED"
            code, info, _ = refusal(lambda: call(b"", metadata=[("authorization", "Bearer one")]))
            assert (code, info.reason) == (grpc.StatusCode.UNIMPLEMENTED, "METHOD_UNKNOWN")
        for counted in ("UNAUTHENTICATED", "UNIMPLEMENTED"):
            sample = f'dynhull_calls_total{{code="{counted}",method="unknown"}}'
            wait_until(lambda sample=sample: scrape(metrics).get(sample) == 1)


def test_one_caller_cannot_have_every_stream(tokens: Tokens) -> None:
    options = ("--tokens", str(tokens.path), "--max-streams-per-caller", "2", "--max-streams", "3")
    with server_process(*options) as server, ExitStack() as stack:
        one, two = (stub(stack, server, token) for token in ("one", "two"))
        one("CreateHull", pb.CreateHullRequest(name="a"))

        def watch(caller: Callable[..., object]) -> grpc.Call:
            watch = caller("Watch", pb.WatchRequest(name="a"))
            next(watch)
            return watch

        def limit(caller: Callable[..., object]) -> dict[str, str]:
            code, info, details = refusal(lambda: watch(caller))
            assert (code, info.reason) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "LIMIT_EXCEEDED")
            assert details[0].violations[0].subject == info.metadata["limit"]
            return dict(info.metadata)

        held = [watch(one), watch(one)]
        assert limit(one) == {"limit": "max_streams_per_caller", "value": "2"}
        held.append(watch(two))
        assert limit(two) == {"limit": "max_streams", "value": "3"}
        held[0].cancel()
        wait_until(lambda: refusal_of(lambda: held.append(watch(one))) is None)
        for each in held:
            each.cancel()


def test_one_caller_cannot_name_every_producer(tokens: Tokens) -> None:
    with (
        server_process("--tokens", str(tokens.path), "--max-producers-per-caller", "1") as server,
        ExitStack() as stack,
    ):
        one, two = (stub(stack, server, token) for token in ("one", "two"))
        one("CreateHull", pb.CreateHullRequest(name="a"))

        def write(caller: Callable[..., object], producer: str) -> object:
            return caller("Apply", pb.ApplyRequest(name="a", batch=POINT, producer=producer, sequence=1))

        write(one, "p")
        _, info, _ = refusal(lambda: write(one, "q"))
        assert dict(info.metadata) == {"limit": "max_producers_per_caller", "value": "1"}
        write(two, "q")


def test_health_watches_are_bounded() -> None:
    with (
        server_process("--max-health-calls-per-caller", "2") as server,
        grpc.insecure_channel(server.address) as channel,
    ):
        health = health_pb2_grpc.HealthStub(channel)
        held = [health.Watch(health_pb2.HealthCheckRequest()) for _ in range(2)]
        for each in held:
            next(each)
        for call in (health.Watch, health.Check):
            _, info, _ = refusal(lambda call=call: list(call(health_pb2.HealthCheckRequest())))
            assert dict(info.metadata) == {"limit": "max_health_calls_per_caller", "value": "2"}
        held.pop().cancel()
        wait_until(lambda: refusal_of(lambda: health.Check(health_pb2.HealthCheckRequest())) is None)
        held.pop().cancel()


def test_health_of_an_unknown_service(channel: grpc.Channel) -> None:
    health = health_pb2_grpc.HealthStub(channel)
    unknown = health_pb2.HealthCheckRequest(service="nobody")
    assert refusal(lambda: health.Check(unknown))[0] == grpc.StatusCode.NOT_FOUND
    watch = health.Watch(unknown)
    assert next(watch).status == health_pb2.HealthCheckResponse.SERVICE_UNKNOWN
    watch.cancel()


@pytest.mark.one_process("each gateway has its own limit")
def test_connections_are_bounded_and_idle_ones_closed() -> None:
    with server_process("--max-connections", "1", "--max-connection-idle", "0.1") as server, ExitStack() as stack:
        channels = [
            stack.enter_context(grpc.insecure_channel(server.address, options=[("grpc.use_local_subchannel_pool", 1)]))
            for _ in range(2)
        ]
        first, second = map(HullServiceStub, channels)
        first.CreateHull(pb.CreateHullRequest(name="a"))
        watch = first.Watch(pb.WatchRequest(name="a"))
        next(watch)
        request = pb.GetHullRequest(name="a")
        with pytest.raises(grpc.RpcError) as caught:
            second.GetHull(request)
        assert caught.value.code() == grpc.StatusCode.UNAVAILABLE
        watch.cancel()  # now the first connection is idle, and makes room
        assert second.GetHull(request, wait_for_ready=True, timeout=PATIENCE).hull.name == "a"


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    return trustme.CA()


@pytest.fixture(scope="module")
def certificate(authority: trustme.CA, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    folder = tmp_path_factory.mktemp("tls")
    issued = authority.issue_cert("localhost", "127.0.0.1")
    (folder / "cert.pem").write_bytes(b"".join(blob.bytes() for blob in issued.cert_chain_pems))
    issued.private_key_pem.write_to_path(folder / "key.pem")
    return ["--tls-cert", str(folder / "cert.pem"), "--tls-key", str(folder / "key.pem")]


def test_metrics_for_other_machines_only_with_tls_and_tokens_or_when_told(
    tokens: Tokens, certificate: list[str]
) -> None:
    metrics = ("--metrics-host", "0.0.0.0", "--metrics-port", "0")
    for options in ([], certificate, ["--tokens", str(tokens.path)]):
        refused = dynhull("serve", "--port", "0", "--in-memory", *metrics, *options)
        assert refused.exit_code == 2
        assert "0.0.0.0 can be reached by other machines" in refused.stderr
    with server_process(*metrics, "--insecure") as server:
        assert server.process.stdout.readline().startswith("metrics on http://0.0.0.0:")


def test_metrics_for_other_machines_need_the_client_certificate_that_calls_need(
    tmp_path: Path, tokens: Tokens, certificate: list[str], authority: trustme.CA
) -> None:
    authority.cert_pem.write_to_path(tmp_path / "ca.pem")
    tokens.write(all=([""], []))
    options = ("--tokens", str(tokens.path), *certificate, "--tls-client-ca", str(tmp_path / "ca.pem"))
    with server_process(*options, "--metrics-host", "0.0.0.0", "--metrics-port", "0") as server:
        port = server.process.stdout.readline().rsplit(":", 1)[1].split("/")[0]
        asked = urllib.request.Request(f"https://127.0.0.1:{port}/metrics", headers={"Authorization": "Bearer all"})
        with pytest.raises(OSError, match=r"certificate required|EOF occurred|reset"):  # whichever comes first
            urllib.request.urlopen(asked, timeout=PATIENCE, context=trusting(authority)).close()
        with urllib.request.urlopen(asked, timeout=PATIENCE, context=trusting(authority, authority)) as response:
            assert response.status == 200


def trusting(authority: trustme.CA, issuer: trustme.CA | None = None) -> ssl.SSLContext:
    """Trusts servers with a certificate of the authority; presents one of the issuer, if any."""
    context = ssl.create_default_context(cadata=authority.cert_pem.bytes().decode())
    if issuer is not None:
        issuer.issue_cert("client@example.org").configure_cert(context)
    return context


def test_metrics_for_other_machines_are_for_who_may_read_everything(
    tokens: Tokens, certificate: list[str], authority: trustme.CA
) -> None:
    tokens.write(all=([""], []), some=(["a"], [""]))
    options = ("--tokens", str(tokens.path), *certificate, "--metrics-host", "0.0.0.0", "--metrics-port", "0")
    with server_process(*options, complaints="UNAUTHENTICATED") as server:
        port = re.fullmatch(r"metrics on https://0.0.0.0:(\d+)/metrics\n", server.process.stdout.readline()).group(1)

        def page(token: str | None) -> str:
            headers = {} if token is None else {"Authorization": f"Bearer {token}"}
            asked = urllib.request.Request(f"https://127.0.0.1:{port}/metrics", headers=headers)
            with urllib.request.urlopen(asked, timeout=PATIENCE, context=trusting(authority)) as response:
                return response.read().decode()

        # A connection that sends nothing delays no other caller.
        with socket.create_connection(("127.0.0.1", int(port))):
            for token, status in ((None, 401), ("wrong", 401), ("some", 403)):
                with pytest.raises(urllib.error.HTTPError) as caught:
                    page(token)
                assert caught.value.code == status
                caught.value.close()
            told = PROCESS.sub("", page("all"))
        assert 'dynhull_calls_total{code="UNAUTHENTICATED",method="metrics"} 2.0' in told
        assert 'dynhull_calls_total{code="PERMISSION_DENIED",method="metrics"} 1.0' in told
