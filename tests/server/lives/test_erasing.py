"""Keys are erased from the past of a hull, on every way to a server, and stay so after a kill."""

import asyncio
import hashlib

import grpc
import numpy as np
import pyarrow.parquet as pq
import pytest
from cases import slow
from command_line import dynhull
from server_process import server_process

from dynhull_client import (
    AsyncHullClient,
    HullClient,
    HullCopy,
    HullUnsuitableError,
    InvalidRequestError,
    PermissionDeniedError,
    UnavailableError,
)
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

KEYS = [f"vehicle {i}" for i in range(40)]
SNAPSHOTS = ("--snapshot-points", "200")


def positions(revision):
    return np.round(np.random.default_rng(revision).random((len(KEYS), 2)), 7)


def write(client, name, keys, batches):
    first = client.get_hull(name).info.revision + 1
    for revision in range(first, first + batches):
        client.put(name, keys, positions(revision))


def test_a_key_is_erased_from_what_can_be_read_of_the_past(tmp_path):
    options = "--data", str(tmp_path), *SNAPSHOTS
    with server_process(*options, killed=True) as server, HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str", history=True)
        write(client, "fleet", KEYS, 30)
        early = client.at("fleet", 12)
        assert early.positions(KEYS[:2]).present.all()
        seen = early.positions(KEYS[1:]).positions
        with pytest.raises(HullUnsuitableError, match="has the key 'vehicle 0' now: remove it first"):
            client.erase_history("fleet", [KEYS[1], KEYS[0]][::-1])
        assert client.at("fleet", 12).positions(KEYS[:1]).present.all()

        client.create_hull("newest", keyed="str", max_points=2, history=True)
        with pytest.raises(HullUnsuitableError, match=r"keeps its 2 newest: .* Shorten its history instead"):
            client.erase_history("newest", KEYS[:1])

        client.remove("fleet", KEYS[:1])
        found = client.erase_history("fleet", KEYS[:1])
        assert (found.first_revision, found.last_revision, found.keys, found.moves) == (1, 31, 1, 31)
        assert client.history("fleet").erasures == (found,)
        assert client.erase_history("fleet", KEYS[:1]) is None

        client.put("fleet", KEYS[:1], [(50, 50)])  # it comes back, and is a new key
        for past in (early, client.at("fleet", 12), client.at("fleet", 30), client.at("fleet", 31)):
            assert not past.positions(KEYS[:1]).present.any()
            assert past.erased or past is early
        np.testing.assert_array_equal(early.positions(KEYS[1:]).positions, seen)
        assert client.at("fleet", 0).erased is False
        assert early.verify().equal
        now = client.at("fleet", 32)
        assert not now.erased
        assert now.positions(KEYS[:1]).positions.tolist() == [[50, 50]]

        copy, past = HullCopy(), client.at("fleet", 30)
        for event in client.replay("fleet", 12, 30, copy=copy):
            revision = event.revision
            assert event.erased
        assert revision == 30
        events = {event.revision: event.erased for event in client.replay("fleet", 30)}
        assert events == {revision: client.at("fleet", revision).erased for revision in events}
        assert set(events.values()) == {True, False}
        np.testing.assert_array_equal(copy.vertices, past.get_hull().vertices)
        with grpc.insecure_channel(server.address) as channel:  # who had the key in its copy does not go on with that
            request = pb.ReplayRequest(name="fleet")
            request.resume.uid, request.resume.revision = client.get_hull("fleet").info.uid, 12
            assert next(iter(HullServiceStub(channel).Replay(request))).event.HasField("snapshot")

        async def other_ways():
            async with AsyncHullClient(server.address) as other:
                await other.remove("fleet", KEYS[2:3])
                return await other.erase_history("fleet", KEYS[2:3])

        assert asyncio.run(other_ways()).moves == 31
        place = "--address", server.address
        assert dynhull("remove", "fleet", "--key", KEYS[3], *place).exit_code == 0
        said = dynhull("history", "erase", "fleet", "--key", KEYS[3], *place)
        assert said.stdout == "fleet: 31 moves of 1 key erased from revisions 1 to 34\n"
        assert "no segment has this key" in dynhull("history", "erase", "fleet", "--key", KEYS[3], *place).stdout
        assert "1 key erased from revisions 1 to 34, 31 moves" in dynhull("history", "fleet", *place).stdout
        said = dynhull("verify", "fleet", "--at", "12", *place)
        assert "fleet: verified at revision 12: 37 points" in said.stdout
        assert said.stderr == "fleet at revision 12: keys that were erased from its past are missing\n"
        server.process.kill()
        server.process.wait()
        files = list(tmp_path.rglob("*.parquet"))
        assert files
        for file in files:
            gone = {KEYS[2], KEYS[3], *(KEYS[:1] if int(file.name.split("-")[1]) <= 31 else ())}
            assert not gone & set(pq.read_table(file).column("key").to_pylist())
    with server_process(*options) as server, HullClient(server.address) as client:
        assert [each.moves for each in client.history("fleet").erasures] == [31, 31, 31]
        assert not client.at("fleet", 12).positions([KEYS[0], KEYS[2], KEYS[3]]).present.any()


@slow
def test_what_many_ask_for_at_once_is_answered_to_each(tmp_path):
    """One of them goes away, one names a key that the hull has, one a key that never was, and two the same key."""
    options = "--data", str(tmp_path), *SNAPSHOTS
    with server_process(*options, killed=True) as server, HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str", history=True)
        write(client, "fleet", KEYS, 12)
        client.remove("fleet", KEYS[:30])
        seen = client.at("fleet", 9).positions(KEYS[30:]).positions

        async def ask():
            async with AsyncHullClient(server.address) as other:
                wanted = [[key] for key in KEYS[:28]] + [KEYS[27:30], [KEYS[35], KEYS[3]], ["nobody"]]
                calls = [asyncio.create_task(other.erase_history("fleet", keys)) for keys in wanted]
                calls[5].cancel()
                return await asyncio.gather(*calls, return_exceptions=True)

        *single, pair, present, nobody = asyncio.run(ask())
        assert isinstance(single.pop(5), asyncio.CancelledError)
        twice = single.pop()  # whoever comes first of these two
        assert {(each.keys, each.moves) for each in single} == {(1, 13)}
        assert (twice.moves if twice else 0, pair.keys, pair.moves) in {(13, 3, 26), (0, 3, 39)}
        assert nobody is None
        assert isinstance(present, HullUnsuitableError)
        assert "has the key 'vehicle 35' now" in str(present)
        # Whether who has gone away has asked for anything depends on when.
        if client.at("fleet", 9).positions([KEYS[5]]).present.any():
            assert client.erase_history("fleet", [KEYS[5]]).moves == 13
        kept = client.history("fleet").erasures
        assert sum(each.moves for each in kept) == 30 * 13
        server.process.kill()
        server.process.wait()
    with server_process(*options) as server, HullClient(server.address) as client:
        assert client.history("fleet").erasures == kept
        past = client.at("fleet", 9)
        assert not past.positions(KEYS[:30]).present.any()
        np.testing.assert_array_equal(past.positions(KEYS[30:]).positions, seen)
    assert dynhull("check", str(tmp_path)).exit_code == 0


def test_where_the_files_are_is_not_told_when_they_cannot_be_written(tmp_path):
    with (
        server_process("--data", str(tmp_path), complaints=None) as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", keyed="str", history=True)
        write(client, "fleet", KEYS, 3)
        client.remove("fleet", KEYS[:1])
        (tmp_path / "history").write_text("in the way")
        with pytest.raises(UnavailableError, match="File exists") as refused:
            client.erase_history("fleet", KEYS[:1])
        assert str(tmp_path) not in str(refused.value)
        (tmp_path / "history").unlink()
        assert client.erase_history("fleet", KEYS[:1]).moves == 4


def test_it_takes_the_rights_to_write_and_to_read_the_past(tmp_path):
    tokens = tmp_path / "tokens.toml"
    rights = {"writer": 'write = [""]\nread = [""]', "reader": 'read = [""]\npast = [""]'}
    rights["both"] = 'read = [""]\nwrite = [""]\npast = [""]'
    tokens.write_text(
        "".join(
            f'[[token]]\nsha256 = "{hashlib.sha256(each.encode()).hexdigest()}"\n{text}\n'
            for each, text in rights.items()
        )
    )
    options = "--data", str(tmp_path / "data"), "--tokens", str(tokens), "--create-on-write"
    with server_process(*options, complaints=None) as server, HullClient(server.address, token="both") as client:
        client.create_hull("a", keyed="str")
        for token, scope in (("writer", "read the past of"), ("reader", "write")):
            with pytest.raises(PermissionDeniedError, match=scope):
                client.with_token(token).erase_history("a", ["k"])
        assert client.erase_history("a", ["k"]) is None
        with pytest.raises(InvalidRequestError, match="at least one key"):
            client.erase_history("a", [])
        client.create_hull("b")
        with pytest.raises(HullUnsuitableError, match="points without keys"):
            client.erase_history("b", ["k"])
