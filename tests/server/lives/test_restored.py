"""A restored backup is another incarnation: nobody takes what is in it for what the server had before.

Nor what is in a folder that was copied while no server used it, or in a database that was dumped, and brought back.
"""

import shutil
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import grpc
import postgresql
import pytest
from cases import slow
from client_kinds import CLIENTS
from command_line import dynhull
from gateway_process import gateway_process
from mortal_server import MortalServer
from postgresql import PostgreSQL
from psycopg.conninfo import conninfo_to_dict
from refusal import refusal
from server_process import shape_options

from dynhull_client import (
    Batch,
    Circle,
    FenceReplacedError,
    HullClient,
    HullCopy,
    HullReplacedError,
    Polygon,
    RestoredError,
    Snapshot,
)
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

AREA = Polygon([[0, 0], [9, 0], [0, 9]])
INSIDE, OUTSIDE, FAR = [1, 1], [20, 20], [40, 40]
FENCES = {"r/dwell": {"dwell": 3600}, "r/delayed": {"min_dwell": 3600}, "r/silent": {"initial": "none"}}

# Batches in the backup, and those that were acknowledged after it.
BACKED_UP, GONE = 3, 2


@dataclass(frozen=True)
class Before:
    """What callers have had from the server before a backup was restored into its folder.

    Attributes:
        client: a client.
        writers: writers by kind of client, each to the hull of that name below "r/".
        copy: the hull "r/sync" at its last revision.
        fence: the uid of the fence "r/fence".
        taken: the uid of the hull "r/taken", to which nobody has written numbered batches.
        address: the address of the server.
    """

    client: HullClient
    writers: dict
    copy: HullCopy
    fence: str
    taken: str
    address: str


def put(writer, number: int) -> None:
    """Put a point, as a batch of its own."""
    writer.put([[number, number**2]])
    writer.flush()


def numbered(name: str, sequence: int, uid: str = "") -> pb.ApplyRequest:
    request = pb.ApplyRequest(name=name, producer="before", sequence=sequence, uid=uid)
    request.batch.inserts.coordinates.extend([0.0, 0.0])
    return request


class Backup:
    """By the commands for it."""

    def __init__(self, folder: Path, request: pytest.FixtureRequest) -> None:
        self.folder = folder
        self.server = MortalServer(folder, *self.options(request), *shape_options())

    def options(self, _: pytest.FixtureRequest) -> tuple[str, ...]:
        """What keeps the hulls."""
        return ()

    def back_up(self) -> None:
        """Keep what the server has."""
        assert dynhull("backup", self.folder / "backup", "--data", self.folder / "data").exit_code == 0

    def restore(self) -> None:
        """Bring it back after the server was killed."""
        (self.folder / "data").rename(self.folder / "lost")
        self.bring_back()
        checked = dynhull("check", self.folder / "data")
        assert checked.exit_code == 0, checked.stderr

    def bring_back(self) -> None:
        """Make the folder anew."""
        assert dynhull("restore", self.folder / "backup", "--data", self.folder / "data").exit_code == 0


class CopiedFolder(Backup):
    """By other programs, while no server uses the folder."""

    def back_up(self) -> None:
        self.server.kill()
        shutil.copytree(self.folder / "data", self.folder / "backup", ignore=shutil.ignore_patterns("sockets"))
        self.server.start()

    def bring_back(self) -> None:
        shutil.copytree(self.folder / "backup", self.folder / "data")


class DumpedDatabase(Backup):
    """By the programs of PostgreSQL."""

    def options(self, request: pytest.FixtureRequest) -> tuple[str, ...]:
        self.postgres: PostgreSQL = request.getfixturevalue("postgres")
        self.url = self.postgres.new_database()
        return "--journal", self.url

    def back_up(self) -> None:
        postgresql.back_up(self.url, self.folder / "dump")

    def restore(self) -> None:
        name = conninfo_to_dict(self.url)["dbname"]
        for sql in (f"DROP DATABASE {name} WITH (FORCE)", f"CREATE DATABASE {name}"):
            self.postgres.query(sql, database="postgres")
        postgresql.bring_back(self.folder / "dump", self.url)


@pytest.fixture(scope="module", params=[Backup, CopiedFolder, DumpedDatabase], ids=lambda way: way.__name__)
def before(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Before]:
    with ExitStack() as stack:
        way = request.param(tmp_path_factory.mktemp("restored"), request)
        server = way.server
        stack.callback(server.kill)
        clients = {kind: stack.enter_context(connect(server.address)) for kind, connect in CLIENTS.items()}
        client, copy = clients["sync"], HullCopy()
        client.create_hull("r/keyed", keyed="str")
        taken = client.create_hull("r/taken").uid
        fence = client.create_fence("r/fence", AREA, "r/keyed")
        for name, more in FENCES.items():
            client.create_fence(name, AREA, "r/keyed", **more)
        client.create_fence("r/left", Circle(*OUTSIDE, 1), "r/keyed")
        client.put("r/keyed", ["a", "b", "c"], [INSIDE, INSIDE, OUTSIDE])
        client.put("r/keyed", ["c"], [FAR])
        client.ack_fence("r/fence", "behind", 1)
        client.ack_fence("r/fence", "uptodate", 3)
        writers = {}
        for kind, each in clients.items():
            each.create_hull(f"r/{kind}")
            writers[kind] = each.writer(f"r/{kind}", producer="before")
            for number in range(BACKED_UP):
                put(writers[kind], number)
        client.apply("r/taken", insert=[[0, 0]])
        client.create_fence("r/near", "r/taken", other_hull="r/sync", near=100)
        way.back_up()
        for writer in writers.values():
            for number in range(BACKED_UP, BACKED_UP + GONE):
                put(writer, number)
        client.put("r/keyed", ["a", "c"], [OUTSIDE, INSIDE])
        client.ack_fence("r/fence", "uptodate", 5)
        next(iter(client.watch("r/sync", copy=copy)))
        server.kill()
        way.restore()
        server.start()
        yield Before(client, writers, copy, fence.uid, taken, server.address)


@pytest.fixture
def stub(before: Before) -> Iterator[HullServiceStub]:
    with grpc.insecure_channel(before.address) as channel:
        yield HullServiceStub(channel)


@slow
@pytest.mark.parametrize("kind", CLIENTS)
def test_a_writer_ends(before: Before, kind: str) -> None:
    writer, revision = before.writers[kind], before.client.get_hull(f"r/{kind}").info.revision
    with pytest.raises(RestoredError) as caught:
        put(writer, 100)
    assert caught.value.last == BACKED_UP
    with pytest.raises(RestoredError), before.client.writer(f"r/{kind}", producer="before", uid=writer.uid):
        pass
    assert before.client.get_hull(f"r/{kind}").info.revision == revision


def test_numbers_that_another_writer_has_taken_since_are_no_duplicates(before: Before, stub: HullServiceStub) -> None:
    with before.client.writer("r/taken", producer="before") as another:
        assert another.sequence == 0
        for number in range(GONE):
            put(another, -number)
    code, info, _ = refusal(lambda: stub.Apply(numbered("r/taken", GONE, before.taken)))
    assert (code, info.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "RESTORED")
    assert (info.metadata["last"], info.metadata["uid"]) == (str(GONE), another.uid)
    assert stub.Apply(numbered("r/taken", GONE, another.uid)).result.duplicate


def test_numbers_that_do_not_say_of_which_hull_they_are(before: Before, stub: HullServiceStub) -> None:
    """A gap may be one of the backup; numbers of the present hull leave gaps by themselves."""
    before.client.create_hull("r/new")
    uid = before.client.get_hull("r/keyed").info.uid
    for name, of, reason in (
        ("r/keyed", "", "RESTORED"),
        ("r/keyed", uid, "SEQUENCE_GAP"),
        ("r/new", "", "SEQUENCE_GAP"),
    ):
        _, info, _ = refusal(partial(stub.Apply, numbered(name, GONE, of)))
        assert info.reason == reason


def test_batches_to_several_hulls(before: Before) -> None:
    """The next number would be taken by all of them, and be that of another batch than before."""
    uids = {f"r/{kind}": writer.uid for kind, writer in before.writers.items()}
    revisions = [before.client.get_hull(name).info.revision for name in uids]
    batches = {name: Batch(insert=[[0, 0]]) for name in uids}
    with pytest.raises(RestoredError) as caught:
        before.client.transfer(batches, producer="before", sequence=BACKED_UP + 1, uids=uids)
    assert (caught.value.last, caught.value.metadata["batch"]) == (BACKED_UP, "0")
    assert [before.client.get_hull(name).info.revision for name in uids] == revisions


def test_rows_over_http_are_numbered_by_producers_too(before: Before) -> None:
    before.client.create_hull("r/another")
    with gateway_process(before.address) as gateway:
        for hull, reason in (("taken", "RESTORED"), ("another", "SEQUENCE_GAP")):
            for call in (("points", {"insert": [[0, 0]]}), ("rows", b"[0, 0]\n", "application/x-ndjson")):
                path, *body = call
                answer = gateway.post(f"/hulls/r%2F{hull}/{path}", *body, Idempotency_Key="http:9")
                assert (answer.status, answer.json["reason"], answer.json["expected"]) == (409, reason, 1)


def test_readers_begin_anew(before: Before) -> None:
    held = before.copy.uid, before.copy.revision
    with pytest.raises(HullReplacedError):
        next(iter(before.client.watch("r/sync", resume=before.copy, reconnect=False)))
    event = next(iter(before.client.watch("r/sync", copy=before.copy)))
    assert isinstance(event, Snapshot)
    assert event.uid != held[0]
    with pytest.raises(FenceReplacedError):
        next(iter(before.client.watch_fence("r/fence", after=0, uid=before.fence)))


@pytest.mark.parametrize(("consumer", "first"), [("behind", 2), ("uptodate", 4)])
def test_streams_of_fences_begin_with_what_is_lost_and_who_is_inside(before: Before, consumer: str, first: int) -> None:
    with before.client.watch_fence("r/fence", consumer) as watch:
        lost, snapshot = next(watch), next(watch)
        assert (lost.type, lost.first, lost.last) == ("lost", first, 4)
        assert (snapshot.type, snapshot.sequence, snapshot.uid) == ("snapshot", 5, lost.uid)
        assert lost.uid != before.fence
        assert [(each.hull, list(each.keys)) for each in snapshot.inside] == [("r/keyed", ["a", "b"])]
        before.client.put("r/keyed", [consumer], [INSIDE])
        assert next(watch).key in ("behind", "uptodate")


@pytest.mark.parametrize("fence", ["r/fence", *FENCES])
def test_who_is_inside_of_a_restored_fence(before: Before, fence: str) -> None:
    inside = before.client.fence_inside(fence)
    keys = {key for each in inside.subjects for key in each.keys}
    assert keys & {"a", "b", "c"} == (set() if fence == "r/delayed" else {"a", "b"})
    verification = before.client.verify("r/keyed")
    assert verification.whole
    assert verification.fences == 2 + len(FENCES)
    assert before.client.fence_inside("r/left").subjects == ()


def test_hulls_that_are_near_stay_near(before: Before) -> None:
    with before.client.watch_fence("r/near", after=0) as watch:
        lost, snapshot = next(watch), next(watch)
    assert (lost.type, snapshot.type) == ("lost", "snapshot")
    assert [each.hull for each in snapshot.inside] == ["r/sync"]
    assert before.client.verify("r/taken").whole
