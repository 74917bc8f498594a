"""Who may talk to the server, and what it says to those who may not."""

import hashlib
from collections.abc import Iterator
from pathlib import Path

import grpc
import pytest
import trustme
from command_line import dynhull
from grpc_health.v1 import health_pb2, health_pb2_grpc
from refusal import refusal
from server_process import Server, server_process

from dynhull_client import (
    Circle,
    HullClient,
    HullFencedError,
    HullNotFoundError,
    HullUnsuitableError,
    PermissionDeniedError,
    UnauthenticatedError,
    UnavailableError,
)
from dynhull_proto.v1 import batch_pb2, feed_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

ROOT, FLEET, READER = "root-token", "fleet-token", "reader-token"


def entry(token: str, read: list[str], write: list[str]) -> str:
    digest = hashlib.sha256(token.encode()).hexdigest()
    return f'[[token]]\nsha256 = "{digest}"\nread = {read}\nwrite = {write}\n'


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    tokens = tmp_path_factory.mktemp("tokens") / "tokens.toml"
    tokens.write_text(
        entry(ROOT, [""], [""]) + entry(FLEET, ["fleet/"], ["fleet/truck-"]) + entry(READER, ["fleet/", "port"], [])
    )
    with server_process("--tokens", str(tokens), "--log-level", "error", "--create-on-write") as server:
        with HullClient(server.address, token=ROOT) as root:
            for name in ("fleet/truck-1", "fleet/van-1", "plane", "port", "port/a"):
                root.apply(name, insert=[[0, 0], [1, 1]])
        yield server


EVERY_CALL = {
    "CreateHull": lambda stub, name: stub.CreateHull(pb.CreateHullRequest(name=name)),
    "DeleteHull": lambda stub, name: stub.DeleteHull(pb.DeleteHullRequest(name=name)),
    "Apply": lambda stub, name: stub.Apply(pb.ApplyRequest(name=name, batch=batch_pb2.Batch())),
    "ApplyTogether": lambda stub, name: stub.ApplyTogether(
        pb.ApplyTogetherRequest(
            batches=[pb.HullBatch(name=each, batch=batch_pb2.Batch()) for each in ("fleet/truck-1", name)]
        )
    ),
    "Ingest": lambda stub, name: stub.Ingest(iter([pb.IngestRequest(name=name)])),
    "Stream": lambda stub, name: list(stub.Stream(iter([pb.StreamRequest(name=name)]))),
    "Recenter": lambda stub, name: stub.Recenter(pb.RecenterRequest(name=name)),
    "SetQuarantine": lambda stub, name: stub.SetQuarantine(pb.SetQuarantineRequest(name=name)),
    "Reshard": lambda stub, name: stub.Reshard(pb.ReshardRequest(name=name, shards=2)),
    "ListHeld": lambda stub, name: stub.ListHeld(pb.ListHeldRequest(name=name)),
    "GetProducer": lambda stub, name: stub.GetProducer(pb.GetProducerRequest(name=name, producer="p")),
    "Locate": lambda stub, name: stub.Locate(pb.LocateRequest(name=name)),
    "Count": lambda stub, name: stub.Count(pb.CountRequest(name=name)),
    "GetPositions": lambda stub, name: stub.GetPositions(pb.GetPositionsRequest(name=name)),
    "ReadEntities": lambda stub, name: next(stub.ReadEntities(pb.ReadEntitiesRequest(name=name))),
    "ReadPoints": lambda stub, name: next(stub.ReadPoints(pb.ReadPointsRequest(name=name))),
    "Support": lambda stub, name: stub.Support(pb.SupportRequest(name=name)),
    "Tangents": lambda stub, name: stub.Tangents(pb.TangentsRequest(name=name)),
    "SamplePoints": lambda stub, name: stub.SamplePoints(pb.SamplePointsRequest(name=name)),
    "Distance": lambda stub, name: stub.Distance(pb.DistanceRequest(name=name)),
    "IntersectLines": lambda stub, name: stub.IntersectLines(pb.IntersectLinesRequest(name=name)),
    "GetHull": lambda stub, name: stub.GetHull(pb.GetHullRequest(name=name)),
    "GetHistory": lambda stub, name: stub.GetHistory(pb.GetHistoryRequest(name=name)),
    "EraseHistory": lambda stub, name: stub.EraseHistory(
        pb.EraseHistoryRequest(name=name, keys=points_pb2.Keys(integers=[1]))
    ),
    "SetHistory": lambda stub, name: stub.SetHistory(pb.SetHistoryRequest(name=name)),
    "GetSeries": lambda stub, name: stub.GetSeries(pb.GetSeriesRequest(name=name)),
    "Watch": lambda stub, name: next(stub.Watch(pb.WatchRequest(name=name))),
    "Track": lambda stub, name: next(stub.Track(pb.TrackRequest(name=name))),
    "Replay": lambda stub, name: next(stub.Replay(pb.ReplayRequest(name=name))),
    "Feed": lambda stub, name: next(stub.Feed(feed_pb2.FeedRequest(name=name))),
    "AckFeed": lambda stub, name: stub.AckFeed(feed_pb2.AckFeedRequest(name=name, consumer="c")),
    "DeleteFeedConsumer": lambda stub, name: stub.DeleteFeedConsumer(
        feed_pb2.DeleteFeedConsumerRequest(name=name, consumer="c")
    ),
    "WatchMany": lambda stub, name: next(stub.WatchMany(pb.WatchManyRequest(names=[name]))),
    "GetLayers": lambda stub, name: stub.GetLayers(pb.GetLayersRequest(name=name, layer_count=1)),
    "GetInfluence": lambda stub, name: stub.GetInfluence(pb.GetInfluenceRequest(name=name)),
    "GetMeasures": lambda stub, name: stub.GetMeasures(pb.GetMeasuresRequest(name=name)),
    "Separate": lambda stub, name: stub.Separate(pb.SeparateRequest(name=name, other_name=name)),
    "PhaseDiagram": lambda stub, name: stub.PhaseDiagram(pb.PhaseDiagramRequest(name=name)),
    "Frontier": lambda stub, name: stub.Frontier(pb.FrontierRequest(name=name)),
    "Verify": lambda stub, name: stub.Verify(pb.VerifyRequest(name=name)),
    "Query": lambda stub, name: next(stub.Query(iter([pb.QueryRequest(reads=[{"verify": {"name": name}}])]))),
}
LISTS = {
    "ListHulls": lambda stub, name: stub.ListHulls(pb.ListHullsRequest(prefix=name)),
    "ListFeedConsumers": lambda stub, name: stub.ListFeedConsumers(feed_pb2.ListFeedConsumersRequest(prefix=name)),
}
WRITES = {
    "CreateHull",
    "DeleteHull",
    "Apply",
    "ApplyTogether",
    "Ingest",
    "Stream",
    "Recenter",
    "SetQuarantine",
    "Reshard",
    "GetProducer",
    "SetHistory",
    "EraseHistory",
}


def test_every_call_is_tried() -> None:
    methods = pb.DESCRIPTOR.services_by_name["HullService"].methods
    assert {method.name for method in methods} == {*EVERY_CALL, *LISTS}


@pytest.mark.parametrize("call", [*EVERY_CALL, *LISTS])
@pytest.mark.parametrize("metadata", [None, "Bearer wrong", "Basic root-token", "root-token", "Bearer "])
def test_without_a_token_nothing_is_answered(guarded: Server, call: str, metadata: str | None) -> None:
    """Not even whether a request is well-formed, or a name one of a hull."""
    with grpc.insecure_channel(guarded.address) as channel:
        if metadata is not None:
            channel = grpc.intercept_channel(channel, Metadata(metadata))
        stub = HullServiceStub(channel)
        answers = []
        for name in ("plane", "nobody", "not a name"):
            refused = refusal(lambda name=name: (EVERY_CALL | LISTS)[call](stub, name))
            answers.append(refused)
        assert answers[0][0] == grpc.StatusCode.UNAUTHENTICATED
        assert answers[0] == answers[1] == answers[2]


class Metadata(
    grpc.UnaryUnaryClientInterceptor,
    grpc.UnaryStreamClientInterceptor,
    grpc.StreamUnaryClientInterceptor,
    grpc.StreamStreamClientInterceptor,
):
    def __init__(self, authorization: str) -> None:
        self._authorization = authorization

    def _intercept(self, proceed, details, request):
        return proceed(details._replace(metadata=[("authorization", self._authorization)]), request)

    intercept_unary_unary = intercept_unary_stream = intercept_stream_unary = intercept_stream_stream = _intercept


@pytest.mark.parametrize("call", [each for each in EVERY_CALL if each != "Query"])  # whose reads are refused one by one
def test_out_of_scope_the_answer_is_the_same_whether_there_is_a_hull_or_not(guarded: Server, call: str) -> None:
    with grpc.insecure_channel(guarded.address) as plain:
        stub = HullServiceStub(grpc.intercept_channel(plain, Metadata(f"Bearer {FLEET}")))
        for name in ("plane", "nobody"):
            code, info, _ = refusal(lambda name=name: EVERY_CALL[call](stub, name))
            assert (code, info.reason) == (grpc.StatusCode.PERMISSION_DENIED, "PERMISSION_DENIED")
            scope, place = "write" if call in WRITES else "read", {"batch": "0"} if call in ("Ingest", "Stream") else {}
            assert dict(info.metadata) == {"scope": scope, "value": name} | place


def test_both_of_two_hulls_must_be_in_scope(guarded: Server) -> None:
    with HullClient(guarded.address, token=FLEET) as fleet:
        assert fleet.separate("fleet/van-1", "fleet/van-1").intersect
        for other in ("plane", "nobody"):
            for pair in (("fleet/van-1", other), (other, "fleet/van-1")):
                with pytest.raises(PermissionDeniedError, match=f"may not read '{other}'"):
                    fleet.separate(*pair)


def test_alarms_need_rights_on_their_name_and_on_their_hulls(guarded: Server) -> None:
    with HullClient(guarded.address, token=FLEET) as fleet, HullClient(guarded.address, token=ROOT) as root:
        for name, watched, scope in (
            ("fleet/van", {"hull": "fleet/van-1"}, "write 'fleet/van'"),
            ("fleet/truck-a", {"hull": "plane"}, "read 'plane'"),
            ("fleet/truck-a", {"hull": "nobody"}, "read 'nobody'"),
            ("fleet/truck-a", {"prefix": "fle"}, "read 'fle'"),
        ):
            with pytest.raises(PermissionDeniedError, match=f"may not {scope}"):
                fleet.create_alarm(name, when="count > 1", **watched)
        root.create_alarm("fleet/all", prefix="fleet/", when="count > 1")
        root.create_alarm("ports", prefix="port", when="count > 1")
        fleet.create_alarm("fleet/truck-a", hull="fleet/van-1", when="count > 1")
        assert [each.name for each in fleet.list_alarms()] == ["fleet/all", "fleet/truck-a"]
        assert fleet.get_alarm("fleet/all").raised >= 2
        for refused in (
            lambda: fleet.acknowledge_alarm("fleet/all", "fleet/van-1"),
            lambda: fleet.mute_alarm("fleet/all", "fleet/van-1", None),
            lambda: fleet.delete_alarm("fleet/all"),
            lambda: fleet.get_alarm("ports"),
            lambda: fleet.ack_alarm("ports", "c", 1),
            lambda: next(fleet.watch_alarm("ports", after=0)),
        ):
            with pytest.raises(PermissionDeniedError):
                refused()
        fleet.acknowledge_alarm("fleet/truck-a", "fleet/van-1")
        for hull in ("plane", "nobody"):  # whether there is one is not told
            for refused in (
                lambda hull=hull: fleet.acknowledge_alarm("fleet/truck-a", hull),
                lambda hull=hull: fleet.mute_alarm("fleet/truck-a", hull, None),
            ):
                with pytest.raises(PermissionDeniedError, match=f"may not read '{hull}'"):
                    refused()
        with pytest.raises(HullFencedError) as fenced:
            root.delete_hull("fleet/van-1")
        assert fenced.value.alarm == "fleet/truck-a"
        for name in ("fleet/all", "fleet/truck-a", "ports"):
            root.delete_alarm(name)


def test_scopes(guarded: Server) -> None:
    with HullClient(guarded.address, token=FLEET) as fleet, HullClient(guarded.address, token=ROOT) as root:
        assert fleet.get_hull("fleet/van-1").info.points == 2
        with pytest.raises(HullNotFoundError):
            fleet.get_hull("fleet/van-2")
        with pytest.raises(PermissionDeniedError):
            fleet.apply("fleet/van-1", insert=[[5, 5]])
        with pytest.raises(PermissionDeniedError):
            fleet.apply("fleet/van-2", insert=[[5, 5]])
        with pytest.raises(PermissionDeniedError), fleet.ingest("fleet/van-1") as stream:
            stream.apply(insert=[[5, 5]])
        assert fleet.apply("fleet/truck-1", insert=[[5, 5]]).points == 3
        assert root.get_hull("fleet/van-1").info.revision == 1
        assert "fleet/van-2" not in [info.name for info in root.list_hulls()]


@pytest.mark.parametrize(
    ("token", "prefix", "names"),
    [
        (ROOT, "", ["fleet/truck-1", "fleet/van-1", "plane", "port", "port/a"]),
        (FLEET, "", ["fleet/truck-1", "fleet/van-1"]),
        (FLEET, "fleet/v", ["fleet/van-1"]),
        (FLEET, "p", []),
        (READER, "", ["fleet/truck-1", "fleet/van-1", "port", "port/a"]),
        (READER, "port/", ["port/a"]),
    ],
)
def test_lists_show_what_may_be_read(guarded: Server, token: str, prefix: str, names: list[str]) -> None:
    with HullClient(guarded.address, token=token) as client:
        assert [info.name for info in client.list_hulls(prefix)] == names


def test_health_needs_no_token(guarded: Server) -> None:
    with grpc.insecure_channel(guarded.address) as channel:
        response = health_pb2_grpc.HealthStub(channel).Check(health_pb2.HealthCheckRequest())
        assert response.status == health_pb2.HealthCheckResponse.SERVING


def test_tokens_are_read_again_when_they_change(tmp_path: Path) -> None:
    tokens = tmp_path / "tokens.toml"

    def replace(text: str) -> None:
        # As editors and configuration tools do it: never half a file.
        new = tmp_path / "new"
        new.write_text(text)
        new.rename(tokens)

    replace(entry("old", [""], [""]))
    options = ("--tokens", str(tokens), "--log-level", "error")
    with (
        server_process(*options, complaints="the tokens do not change") as server,
        HullClient(server.address, token="old") as old,
        HullClient(server.address, token="new") as new,
    ):
        old.create_hull("a")
        with pytest.raises(UnauthenticatedError):
            new.get_hull("a")
        replace(entry("new", [""], []))
        with pytest.raises(UnauthenticatedError):
            old.get_hull("a")
        assert new.get_hull("a").info.name == "a"
        replace("[[token")
        assert new.get_hull("a").info.name == "a"


def test_a_new_token_and_its_entry(tmp_path: Path) -> None:
    useless = dynhull("token", "--read", "fleet/", "--past", "port/")
    assert useless.exit_code != 0
    assert "of no use without --read port/" in useless.stderr
    made = dynhull("token", "--name", "x", "--read", "", "--write", "fleet/", "--past", "fleet/a")
    assert made.exit_code == 0
    tokens = tmp_path / "tokens.toml"
    tokens.write_text(made.stdout)
    token = made.stderr.removeprefix("token: ").strip()
    options = ("--tokens", str(tokens), "--log-level", "error", "--data", str(tmp_path / "data"))
    with server_process(*options) as server, HullClient(server.address, token=token) as client:
        for name in ("fleet/a", "fleet/b"):
            client.create_hull(name)
            assert client.history(name).last_revision == 0  # how much is kept is no past
        assert client.at("fleet/a", 0).revision == 0
        with pytest.raises(PermissionDeniedError, match="read the past of"):
            client.at("fleet/b", 0)
        with pytest.raises(PermissionDeniedError):
            client.create_hull("plane")


@pytest.fixture(scope="module")
def authority() -> trustme.CA:
    return trustme.CA()


@pytest.fixture(scope="module")
def certificate(authority: trustme.CA, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The options that make a server use a certificate of the authority's."""
    folder = tmp_path_factory.mktemp("tls")
    issued = authority.issue_cert("localhost", "127.0.0.1")
    (folder / "cert.pem").write_bytes(b"".join(blob.bytes() for blob in issued.cert_chain_pems))
    issued.private_key_pem.write_to_path(folder / "key.pem")
    authority.cert_pem.write_to_path(folder / "ca.pem")
    return ["--tls-cert", str(folder / "cert.pem"), "--tls-key", str(folder / "key.pem")]


def test_tls(authority: trustme.CA, certificate: list[str]) -> None:
    trusting = grpc.ssl_channel_credentials(authority.cert_pem.bytes())
    suspicious = grpc.ssl_channel_credentials(trustme.CA().cert_pem.bytes())
    with server_process(*certificate) as server:
        with HullClient(server.address, tls=trusting) as client:
            client.create_hull("a")
            assert client.apply("a", insert=[[1, 2]]).points == 1
        for tls in (None, suspicious):
            with HullClient(server.address, tls=tls) as client, pytest.raises(UnavailableError):
                client.get_hull("a")


def test_mutual_tls(authority: trustme.CA, certificate: list[str]) -> None:
    ca = authority.cert_pem.bytes()

    def credentials(issuer: trustme.CA) -> grpc.ChannelCredentials:
        issued = issuer.issue_cert("client@example.org")
        chain = b"".join(blob.bytes() for blob in issued.cert_chain_pems)
        return grpc.ssl_channel_credentials(ca, issued.private_key_pem.bytes(), chain)

    client_ca = str(Path(certificate[1]).with_name("ca.pem"))
    with server_process(*certificate, "--tls-client-ca", client_ca) as server:
        with HullClient(server.address, tls=credentials(authority)) as client:
            assert client.create_hull("a").revision == 0
        for tls in (grpc.ssl_channel_credentials(ca), credentials(trustme.CA())):
            with HullClient(server.address, tls=tls) as client, pytest.raises(UnavailableError):
                client.get_hull("a")


def test_other_machines_only_with_tls_and_tokens_or_when_told(tmp_path: Path, certificate: list[str]) -> None:
    tokens = tmp_path / "tokens.toml"
    tokens.write_text(entry("t", [""], [""]))
    for options in ([], certificate, ["--tokens", str(tokens)]):
        refused = dynhull("serve", "--host", "0.0.0.0", "--port", "0", *options)
        assert refused.exit_code == 2
        assert "--insecure" in refused.stderr
    for options in ([*certificate, "--tokens", str(tokens)], ["--insecure"]):
        with server_process("--host", "0.0.0.0", *options) as server:
            assert server.address.startswith("0.0.0.0:")


@pytest.mark.parametrize(
    ("options", "text", "message"),
    [
        (["--tls-cert", "x.pem"], None, "--tls-cert and --tls-key must be given together"),
        (["--tls-client-ca", "x.pem"], None, "--tls-client-ca needs --tls-cert"),
        (["--tls-cert", "no.pem", "--tls-key", "no.pem"], None, "no.pem"),
        (["--tokens", "no.toml"], None, "no.toml"),
        (["--tokens", "bad.toml"], "[[token", "bad.toml"),
        (["--tokens", "bad.toml"], '[[token]]\nsha256 = "abc"', "bad.toml: token.0.sha256"),
        (["--tokens", "bad.toml"], '[[token]]\ntoken = "abc"', "bad.toml: token.0"),
    ],
)
def test_what_cannot_protect_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], text: str | None, message: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if text is not None:
        Path("bad.toml").write_text(text)
    refused = dynhull("serve", "--port", "0", *options)
    assert refused.exit_code == 2
    assert message in refused.stderr
    assert "Traceback" not in refused.stderr


def test_a_point_is_not_told_either(guarded: Server) -> None:
    with HullClient(guarded.address, token=READER) as reader, HullClient(guarded.address, token=ROOT) as root:
        before = root.get_hull("port")
        with pytest.raises(PermissionDeniedError):
            reader.apply("port", delete=[[8, 8]])
        with pytest.raises(PermissionDeniedError):
            reader.delete_hull("port")
        after = root.get_hull("port")
        assert (after.revision, after.info.uid) == (before.revision, before.info.uid)
        assert points_pb2.Points(packed=after.vertices.tobytes()) == points_pb2.Points(packed=before.vertices.tobytes())


def test_a_refusal_names_no_fence_that_the_caller_may_not_read(guarded: Server) -> None:
    with HullClient(guarded.address, token=FLEET) as fleet, HullClient(guarded.address, token=ROOT) as root:
        root.create_hull("fleet/truck-9", keyed="str", geographic=True)
        root.put("fleet/truck-9", ["a"], [[1, 1]])
        for fence, told in (("secret/fence", None), ("fleet/fence", "fleet/fence")):
            root.create_fence(fence, area=Circle(0, 0, 1), subjects="fleet/truck-9")
            for refused in (fleet.delete_hull, fleet.recenter):
                with pytest.raises(HullFencedError) as error:
                    refused("fleet/truck-9")
                assert error.value.fence == told
                assert "secret" not in str(error.value)
                with pytest.raises(HullFencedError, match=fence):
                    getattr(root, refused.__name__)("fleet/truck-9")
            root.delete_fence(fence)
        root.delete_hull("fleet/truck-9")


def test_a_fence_gives_a_centre_only_to_hulls_that_its_maker_may_write(guarded: Server) -> None:
    with HullClient(guarded.address, token=FLEET) as fleet, HullClient(guarded.address, token=ROOT) as root:
        for name in ("fleet/boat", "fleet/truck-8"):
            root.create_hull(name, keyed="str", geographic=True)
        with pytest.raises(HullUnsuitableError, match="has no centre so far"):
            fleet.create_fence("fleet/truck-boat", area=Circle(10, 50, 1), subjects="fleet/boat")
        fleet.create_fence("fleet/truck-yard", area=Circle(10, 50, 1), subjects="fleet/truck-8")
        found = root.get_hull("fleet/boat").info.center, root.get_hull("fleet/truck-8").info.center
        assert found == (None, (10, 50))
        root.delete_fence("fleet/truck-yard")
        for name in ("fleet/boat", "fleet/truck-8"):
            root.delete_hull(name)
