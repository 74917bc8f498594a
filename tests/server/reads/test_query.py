"""Many reads in one call."""

import hashlib
import itertools
import queue
import threading
from pathlib import Path

import grpc
import numpy as np
import pytest
from cases import slow
from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status
from grpc_status import rpc_status
from metrics import measured, scrape
from patience import PATIENCE, wait_until
from processor import needs_proc, processor_time, wait_for_rest
from refusal import refusal
from server_process import server_process

from dynhull_client import HullClient
from dynhull_proto.v1 import batch_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

RNG = np.random.default_rng(19)
POINTS = RNG.uniform(0.1, 1, (200, 2))  # suits every kind of read
ROWS = points_pb2.Points(packed=RNG.uniform(-1, 2, (9, 2)).tobytes())
OTHERS = points_pb2.Points(packed=RNG.uniform(-1, 2, (9, 2)).tobytes())
SHARES = points_pb2.Points(packed=RNG.uniform(0.2, 0.8, (9, 2)).tobytes())


@pytest.fixture
def filled(stub: HullServiceStub, hull: str) -> str:
    """A keyed hull beside a hull of its name with "/points"."""
    packed = points_pb2.Points(packed=POINTS.tobytes())
    for name, config, batch in (
        (f"{hull}/points", {}, {"inserts": packed}),
        (f"{hull}/keys", {"identity": "IDENTITY_INTEGER_KEYS"}, {"puts": {"keys": keys(range(200)), "points": packed}}),
    ):
        stub.CreateHull(pb.CreateHullRequest(name=name, config=config))
        stub.Apply(pb.ApplyRequest(name=name, batch=batch_pb2.Batch(**batch), producer="p", sequence=1))
    return hull


def keys(values: range) -> points_pb2.Keys:
    return points_pb2.Keys(integers=values)


def reads_of(hull: str) -> list[pb.Read]:
    """A read of every kind, and of some in several ways."""
    name, keyed = f"{hull}/points", f"{hull}/keys"
    return [
        pb.Read(locate=pb.LocateRequest(name=name, points=ROWS)),
        pb.Read(locate=pb.LocateRequest(name=name, keys=keys(range(7)), keys_of=keyed)),
        pb.Read(count=pb.CountRequest(name=name, points=ROWS)),
        pb.Read(get_positions=pb.GetPositionsRequest(name=keyed, keys=keys(range(195, 205)))),
        pb.Read(support=pb.SupportRequest(name=name, directions=ROWS)),
        pb.Read(support=pb.SupportRequest(name=keyed, directions=ROWS, include_keys=True)),
        pb.Read(tangents=pb.TangentsRequest(name=name, points=ROWS, encoding="POINT_ENCODING_COORDINATES")),
        pb.Read(distance=pb.DistanceRequest(name=name, points=ROWS)),
        pb.Read(intersect_lines=pb.IntersectLinesRequest(name=name, origins=ROWS, targets=OTHERS)),
        pb.Read(get_hull=pb.GetHullRequest(name=keyed, include_keys=True)),
        pb.Read(sample_points=pb.SamplePointsRequest(name=name, sample_size=5)),
        pb.Read(get_measures=pb.GetMeasuresRequest(name=name)),
        pb.Read(separate=pb.SeparateRequest(name=name, other_name=keyed)),
        pb.Read(phase_diagram=pb.PhaseDiagramRequest(name=name, entries=SHARES)),
        pb.Read(frontier=pb.FrontierRequest(name=name, points=SHARES, rates=[0.01])),
        pb.Read(verify=pb.VerifyRequest(name=name)),
        pb.Read(get_producer=pb.GetProducerRequest(name=name, producer="p")),
        pb.Read(get_layers=pb.GetLayersRequest(name=keyed, layer_count=2, include_keys=True)),
        pb.Read(get_influence=pb.GetInfluenceRequest(name=name)),
    ]


def asked(stub: HullServiceStub, *messages: list[pb.Read]) -> list[pb.ReadAnswer]:
    """The answers to the reads of some messages."""
    requests = [pb.QueryRequest(reads=reads) for reads in messages]
    return [answer for response in stub.Query(iter(requests), timeout=PATIENCE) for answer in response.answers]


def alone(stub: HullServiceStub, read: pb.Read) -> pb.ReadAnswer:
    """The answer of the read's own method."""
    kind = read.WhichOneof("read")
    method = getattr(stub, type(getattr(read, kind)).__name__.removesuffix("Request"))
    try:
        return pb.ReadAnswer(**{kind: method(getattr(read, kind))})
    except grpc.RpcError as error:
        status = rpc_status.from_call(error)
        return pb.ReadAnswer(error=pb.ReadError.FromString(status.SerializeToString()))


def reason(answer: pb.ReadAnswer) -> str:
    info = ErrorInfo()
    assert Status.FromString(answer.error.SerializeToString()).details[0].Unpack(info)
    return info.reason


@pytest.mark.whole_hull("inner layers")
def test_every_kind_of_read_is_answered_as_its_own_method_does(stub: HullServiceStub, filled: str) -> None:
    reads = reads_of(filled)
    assert {read.WhichOneof("read") for read in reads} == {field.name for field in pb.Read.DESCRIPTOR.fields}
    expected = [alone(stub, read) for read in reads]
    assert not any(answer.HasField("error") for answer in expected)
    assert asked(stub, reads) == expected
    assert asked(stub, *([read] for read in reads)) == expected
    assert asked(stub, reads * 3, [], reads) == expected * 4


def bad_reads(hull: str) -> list[pb.Read]:
    name, none = f"{hull}/points", f"{hull}/none"
    odd = points_pb2.Points(packed=bytes(17))
    nan = points_pb2.Points(packed=np.array([[0, 0], [1, np.nan]]).tobytes())
    return [
        pb.Read(locate=pb.LocateRequest(name=none, points=ROWS)),
        pb.Read(locate=pb.LocateRequest(name="not a name", points=ROWS)),
        pb.Read(locate=pb.LocateRequest(name=name, points=odd)),
        pb.Read(locate=pb.LocateRequest(name=name, points=nan)),
        pb.Read(locate=pb.LocateRequest(name=name, points=ROWS, keys_of=name)),
        pb.Read(count=pb.CountRequest(name=name, points=nan)),
        pb.Read(get_positions=pb.GetPositionsRequest(name=name, keys=keys(range(3)))),
        pb.Read(support=pb.SupportRequest(name=name, directions=points_pb2.Points(coordinates=[1, 0, 0, 0]))),
        pb.Read(support=pb.SupportRequest(name=hull, directions=ROWS)),
        pb.Read(intersect_lines=pb.IntersectLinesRequest(name=name, origins=ROWS, targets=ROWS)),
        pb.Read(sample_points=pb.SamplePointsRequest(name=name, sample_size=-1)),
        pb.Read(separate=pb.SeparateRequest(name=name, other_name=hull)),
        pb.Read(get_producer=pb.GetProducerRequest(name=name)),
        pb.Read(get_hull=pb.GetHullRequest(name=name, view=77)),
    ]


@pytest.mark.whole_hull("inner layers")
def test_a_refused_read_has_the_error_of_its_own_method_and_ends_nothing(stub: HullServiceStub, filled: str) -> None:
    good, bad = reads_of(filled), bad_reads(filled)
    mixed = [read for pair in itertools.zip_longest(bad, good) for read in pair if read is not None]
    expected = [alone(stub, read) for read in mixed]
    assert sum(answer.HasField("error") for answer in expected) == len(bad)
    assert asked(stub, mixed, mixed) == expected * 2


def test_a_read_of_no_known_kind(stub: HullServiceStub, filled: str) -> None:
    newer = pb.Read.FromString(b"\xfa\x06\x03new")  # field 111
    first, second, third = asked(stub, [pb.Read(), newer, reads_of(filled)[0]])
    assert {reason(first), reason(second)} == {"INVALID_FIELD"}
    assert "reads[1]" in second.error.message
    assert len(third.locate.sides) == 9


@pytest.mark.parametrize("kind", ["locate", "distance", "support"])
def test_runs_of_like_reads(stub: HullServiceStub, filled: str, kind: str) -> None:
    """Reads of one hull next to each other are answered together, and nobody notices."""
    rng = np.random.default_rng(20)

    def read(xy: np.ndarray, name: str = f"{filled}/points", **more: object) -> pb.Read:
        kinds = {"locate": pb.LocateRequest, "distance": pb.DistanceRequest, "support": pb.SupportRequest}
        field = "directions" if kind == "support" else "points"
        rows = points_pb2.Points(packed=np.asarray(xy, "<f8").tobytes())
        return pb.Read(**{kind: kinds[kind](name=name, **{field: rows}, **more)})

    one = [read(xy) for xy in rng.uniform(-1, 2, (300, 1, 2))]
    several = [read(xy) for xy in rng.uniform(-1, 2, (20, 7, 2))]
    odd = [
        read(np.empty((0, 2))),
        read([[np.nan, 0]]),
        read([[0, np.inf]]),
        read([[0.0, -0.0]]),
        read([[0.5, 0.5]], f"{filled}/keys"),
        read([[0.5, 0.5]], f"{filled}/none"),
        read([[0.5, 0.5]], min_revision=1),
        read([[0.75, 0.5]], min_revision=1),
        read(POINTS[:1]),
    ]
    if kind == "support":
        odd += [read([[1, 0]], f"{filled}/keys", include_keys=True)] * 2
        odd += [read([[1, 0]], encoding="POINT_ENCODING_COORDINATES")] * 2
    reads = one + several + odd + one[:5] + odd[1:3] + one[:2] + [read([[0, 0]], f"{filled}/none")] * 3
    assert asked(stub, reads) == [alone(stub, each) for each in reads]


class Conversation:
    """A Query call whose messages are sent one by one."""

    def __init__(self, stub: HullServiceStub) -> None:
        self._messages: queue.SimpleQueue[pb.QueryRequest | None] = queue.SimpleQueue()
        self.call = stub.Query(iter(self._messages.get, None), timeout=PATIENCE)

    def send(self, *reads: pb.Read) -> None:
        self._messages.put(pb.QueryRequest(reads=reads))

    def end(self) -> None:
        self._messages.put(None)

    def receive(self, least: int = 1) -> list[pb.ReadAnswer]:
        """The answers of the next message, or of as many as have so many."""
        answers: list[pb.ReadAnswer] = []
        while len(answers) < least:
            answers += next(self.call).answers
        return answers


def at(name: str, revision: int) -> pb.Read:
    return pb.Read(get_hull=pb.GetHullRequest(name=name, min_revision=revision, view=pb.HULL_VIEW_BASIC))


def test_a_read_waits_for_its_revision_and_those_before_it_do_not(stub: HullServiceStub, filled: str) -> None:
    name = f"{filled}/points"
    talk = Conversation(stub)
    talk.send(at(name, 0), at(name, 1), at(name, 2), at(name, 0))
    assert [answer.get_hull.hull.revision for answer in talk.receive(2)] == [1, 1]
    stub.Apply(pb.ApplyRequest(name=name, batch={"inserts": {"coordinates": [5, 5]}}))
    assert [answer.get_hull.hull.revision for answer in talk.receive(2)] == [2, 2]
    talk.send(pb.Read(separate=pb.SeparateRequest(name=name, other_name=f"{filled}/keys", other_min_revision=2)))
    stub.DeleteHull(pb.DeleteHullRequest(name=f"{filled}/keys"))
    assert [reason(answer) for answer in talk.receive()] == ["HULL_NOT_FOUND"]
    talk.end()
    assert list(talk.call) == []


def test_each_answer_is_of_one_revision_while_the_hull_changes(address: str, stub: HullServiceStub, hull: str) -> None:
    """Revision r is a square of side r; a read of two of its corners and a point beyond sees one square."""
    with HullClient(address) as client:
        client.apply(hull, insert=[[0, 0], [1, 0], [1, 1], [0, 1]])
        rows = np.arange(0.5, 400.5)
        packed = points_pb2.Points(packed=np.column_stack((rows, rows)).tobytes())
        read = pb.Read(locate=pb.LocateRequest(name=hull, points=packed))
        stop = threading.Event()

        def grow() -> None:
            for side in itertools.count(1):
                if stop.is_set():
                    return
                old, new = [[side, 0], [side, side], [0, side]], [[side + 1, 0], [side + 1] * 2, [0, side + 1]]
                client.apply(hull, insert=new, delete=old)

        writer = threading.Thread(target=grow)
        writer.start()
        try:
            answers = [answer.locate for _ in range(40) for answer in asked(stub, [read] * 9)]
        finally:
            stop.set()
            writer.join()
        assert answers[0].revision < answers[-1].revision
        for answer in answers:
            inside = np.frombuffer(answer.sides, np.int8) == 1
            assert np.count_nonzero(inside) == min(answer.revision, 400)
        revisions = [answer.revision for answer in answers]
        assert revisions == sorted(revisions)


def test_answers_come_in_parts_and_none_is_too_large() -> None:
    points = np.random.default_rng(3).uniform(-1, 1, (20_000, 2))
    with server_process("--max-message-bytes", "100000") as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        for name, count in (("small", 5_000), ("large", 10_000)):
            stub.CreateHull(pb.CreateHullRequest(name=name))
            for rows in np.array_split(points[:count], 4):
                stub.Apply(pb.ApplyRequest(name=name, batch={"inserts": {"packed": rows.tobytes()}}))
        whole = [
            pb.Read(sample_points=pb.SamplePointsRequest(name=each, sample_size=9_000)) for each in ("small", "large")
        ]
        expected = [alone(stub, read) for read in whole]
        assert reason(expected[1]) == "LIMIT_EXCEEDED"
        responses = list(stub.Query(iter([pb.QueryRequest(reads=whole * 5)])))
        assert max(response.ByteSize() for response in responses) < 2**18
        assert [answer for response in responses for answer in response.answers] == expected * 5
        many = [at("small", 0)] * 3_000
        assert len(asked(stub, many)) == 3_000
        too_large = [pb.QueryRequest(reads=whole), pb.QueryRequest(reads=many * 4)]
        call = stub.Query(iter(too_large))
        assert len(next(call).answers) == 2
        code, info, _ = refusal(lambda: next(call))
        assert (code, info.metadata["limit"]) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "max_message_bytes")


def test_what_is_no_message_ends_the_call_after_the_answers_before_it(channel: grpc.Channel, filled: str) -> None:
    query = channel.stream_stream("/dynhull.v1.HullService/Query", response_deserializer=pb.QueryResponse.FromString)
    good = pb.QueryRequest(reads=reads_of(filled)[:2]).SerializeToString()
    call = query(iter([good, b"\xff", good]), timeout=PATIENCE)
    assert len(next(call).answers) == 2
    code, info, _ = refusal(lambda: next(call))
    assert (code, info.reason) == (grpc.StatusCode.INVALID_ARGUMENT, "MALFORMED_MESSAGE")


def test_a_call_without_reads(stub: HullServiceStub) -> None:
    assert list(stub.Query(iter([]))) == []
    assert asked(stub, [], []) == []


def test_a_draining_server_ends_the_call() -> None:
    with server_process() as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name="a"))
        idle, waiting = Conversation(stub), Conversation(stub)
        idle.send(at("a", 0))
        waiting.send(at("a", 0), at("a", 9))
        assert len(idle.receive()) == len(waiting.receive()) == 1
        server.process.terminate()
        for each in (idle, waiting):
            code, info, _ = refusal(each.receive)
            assert (code, info.reason) == (grpc.StatusCode.UNAVAILABLE, "DRAINING")
            each.end()


def test_prefixes_hold_for_each_read_and_a_removed_token_ends_the_call(tmp_path: Path) -> None:
    tokens = tmp_path / "tokens.toml"

    def allow(*prefixes: str) -> None:
        digest = hashlib.sha256(b"secret").hexdigest()
        new = tmp_path / "new"
        new.write_text(f'[[token]]\nsha256 = "{digest}"\nread = {list(prefixes)}\nwrite = ["fleet/"]\n')
        new.rename(tokens)

    allow("fleet/")
    options = ("--tokens", str(tokens))
    with (
        server_process(*options, complaints="PERMISSION_DENIED") as server,
        grpc.insecure_channel(server.address) as channel,
        HullClient(server.address, token="secret") as client,
    ):
        for name in ("fleet/a", "fleet/b"):
            client.create_hull(name)
        stub = HullServiceStub(grpc.intercept_channel(channel, Bearer()))
        talk = Conversation(stub)
        other = pb.Read(separate=pb.SeparateRequest(name="fleet/a", other_name="plane"))
        talk.send(at("fleet/a", 0), at("plane", 0), other, at("nobody", 0), at("fleet/b", 0))
        answers = talk.receive()
        assert [each.WhichOneof("answer") for each in answers] == ["get_hull", "error", "error", "error", "get_hull"]
        assert {reason(each) for each in answers[1:4]} == {"PERMISSION_DENIED"}
        allow("fleet/b")  # the call goes on: what it has read before matters no more

        def readable() -> list[str]:
            talk.send(at("fleet/a", 0), at("fleet/b", 0))
            return [each.WhichOneof("answer") for each in talk.receive()]

        wait_until(lambda: readable() == ["error", "get_hull"])
        talk.send(at("fleet/b", 1))
        tokens.write_text("")
        code, info, _ = refusal(talk.receive)
        assert (code, info.reason) == (grpc.StatusCode.UNAUTHENTICATED, "UNAUTHENTICATED")
        talk.end()


class Bearer(grpc.UnaryUnaryClientInterceptor, grpc.StreamStreamClientInterceptor):
    def intercept_unary_unary(self, proceed, details, request):
        return proceed(details._replace(metadata=[("authorization", "Bearer secret")]), request)

    intercept_stream_stream = intercept_unary_unary


def endless(message: pb.QueryRequest, sent: list[None]):
    while True:
        sent.append(None)
        yield message


SMALL_WINDOW = [("grpc.http2.bdp_probe", 0)]


def ended(address: str) -> float:
    """The number of Query calls that have ended, with whatever status: a server may take a departure for the end."""
    samples = scrape(address).items()
    return sum(value for name, value in samples if name.startswith("dynhull_calls_total") and '"Query"' in name)


@slow
@pytest.mark.long
@needs_proc
def test_a_client_that_does_not_read_its_answers_is_not_read_either() -> None:
    """It would send for ever; the server rests, has taken little, and others are answered."""
    with (
        measured("--scrub-cpu", "0") as (server, address),
        HullClient(server.address) as client,
        grpc.insecure_channel(server.address, SMALL_WINDOW) as channel,
    ):
        client.create_hull("a")
        client.apply("a", insert=POINTS)
        message = pb.QueryRequest(reads=[pb.Read(get_hull=pb.GetHullRequest(name="a"))] * 64)
        sent: list[None] = []
        call = HullServiceStub(channel).Query(endless(message, sent))
        next(call)
        wait_for_rest(server.process.pid)
        before = scrape(address)
        assert len(sent) < 100_000
        assert client.get_hull("a").info.points == len(POINTS)
        wait_for_rest(server.process.pid)
        after = scrape(address)
        count = 'dynhull_query_reads_total{code="OK",method="GetHull"}'
        assert 64 <= before[count] == after[count]
        for _ in range(100):
            next(call)
        wait_until(lambda: scrape(address)[count] > before[count])
        call.cancel()
        wait_until(lambda: ended(address) == 1)


@needs_proc
def test_a_client_that_takes_too_long_is_told() -> None:
    with (
        server_process("--max-watch-lag", "0.01", "--scrub-cpu", "0") as server,
        HullClient(server.address) as client,
        grpc.insecure_channel(server.address, SMALL_WINDOW) as channel,
    ):
        client.create_hull("a")
        client.apply("a", insert=POINTS)
        message = pb.QueryRequest(reads=[pb.Read(get_hull=pb.GetHullRequest(name="a"))] * 64)
        call = HullServiceStub(channel).Query(endless(message, []))
        wait_for_rest(server.process.pid)  # without reading
        code, info, _ = refusal(lambda: list(call))
        assert (code, info.metadata["limit"]) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "max_watch_lag")


@slow
@pytest.mark.long
@needs_proc
def test_callers_that_leave_in_the_middle_leave_nothing_behind() -> None:
    """Cancelled while a read waits, while one is computed, between messages and while answers are sent."""
    points = np.random.default_rng(5).normal(size=(200_000, 2))
    entries = points_pb2.Points(packed=np.random.default_rng(12).uniform(0, 1, (20_000, 2)).tobytes())
    with (
        measured("--scrub-cpu", "0") as (server, address),
        HullClient(server.address) as client,
        grpc.insecure_channel(server.address, SMALL_WINDOW) as channel,
    ):
        pid = server.process.pid
        client.create_hull("a")
        client.apply("a", insert=points)
        client.create_hull("phases")
        client.apply("phases", insert=[[0, 0], [0.5, -1], [1, 0]])
        stub = HullServiceStub(channel)
        diagram = pb.Read(phase_diagram=pb.PhaseDiagramRequest(name="phases", entries=entries))
        begun = processor_time(pid)
        client.phase_diagram("phases", np.frombuffer(entries.packed).reshape(-1, 2))
        one = processor_time(pid) - begun
        leaving = [[at("a", 0), at("a", 9)], [at("a", 0), diagram] * 9, [at("a", 0)], [at("a", 0)] * 5_000]
        talks = []
        for reads in leaving * 5:
            talks.append(Conversation(stub))
            talks[-1].send(*reads)
            talks[-1].receive()
            assert talks[-1].call.cancel()
        begun = processor_time(pid)
        wait_for_rest(pid)
        assert processor_time(pid) - begun < 10 * one  # of 45 that were asked for
        assert ended(address) == len(talks)
        for talk in talks:
            talk.end()
        assert client.apply("a", insert=[[9, 9]]).revision == 2
        assert len(asked(stub, [at("a", 2)] * 3)) == 3
