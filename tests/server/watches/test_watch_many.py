"""Those who watch many hulls hold the newest state of each: across deletions, lost connections and restarts."""

import asyncio
import signal
from collections.abc import Iterator
from datetime import timedelta
from itertools import count
from pathlib import Path

import grpc
import numpy as np
import pytest
from command_line import dynhull
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from refusal import refusal
from server_process import server_process

from dynhull_client import AsyncHullClient, HullClient, HullCopies, InvalidRequestError, ManyChange, ManyWatch
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]


@pytest.fixture
def client(address: str) -> Iterator[HullClient]:
    with HullClient(address) as client:
        yield client


def until(watch: Iterator[ManyChange], kind: str) -> list[ManyChange]:
    """The changes up to the next one of a kind."""
    seen = []
    for change in watch:
        seen.append(change)
        if change.kind == kind:
            return seen
    raise AssertionError(f"the watch has ended without {kind}: {seen}")


def said(changes: list[ManyChange]) -> list[tuple[str, str, int]]:
    return [(each.kind, each.hull, each.revision) for each in changes if each.kind != "position"]


def states(client: HullClient, prefix: str) -> dict[str, tuple[str, int, list[list[float]]]]:
    found = {}
    for info in client.list_hulls(prefix):
        hull = client.get_hull(info.name)
        found[info.name] = info.uid, hull.info.revision, hull.vertices.tolist()
    return found


def held(copies: HullCopies) -> dict[str, tuple[str, int, list[list[float]]]]:
    return {name: (copy.uid, copy.revision, copy.vertices.tolist()) for name, copy in copies.items()}


def test_a_picture_then_what_changes(client: HullClient, name: str) -> None:
    for part in ("a", "b"):
        client.create_hull(f"{name}/{part}")
    client.apply(f"{name}/a", insert=SQUARE)
    with client.watch_many(f"{name}/") as watch:
        picture = until(watch, "complete")
        assert sorted(said(picture[:-1])) == [("state", f"{name}/a", 1), ("state", f"{name}/b", 0)]
        client.delete_hull(f"{name}/b")
        client.create_hull(f"{name}/c")
        client.apply(f"{name}/a", insert=[[9, 9]])
        assert set(said(until(watch, "position"))) == {
            ("gone", f"{name}/b", 0),
            ("state", f"{name}/c", 0),
            ("state", f"{name}/a", 2),
        }


def test_a_summary_has_what_the_hull_has(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str", geographic=True, center=(9.0, 53.0))
    client.put(name, ["k", "l", "m"], [[9, 53], [10, 53], [9, 54]])
    hull = client.get_hull(name)
    with client.watch_many(names=[name]) as watch:
        state = next(watch)
    assert (state.uid, state.revision, state.points, state.distinct) == (hull.info.uid, 1, 3, 3)
    assert (state.vertex_count, state.geographic, state.center) == (3, True, (9.0, 53.0))
    assert state.measures is not None
    assert state.measures.area == hull.measures.area
    assert state.measures.diameter == client.get_measures(name).diameter
    assert state.vertices is None
    assert state.changed is not None


def test_every_look_says_the_same_measures_and_when_the_hull_changed(client: HullClient, name: str) -> None:
    client.create_hull(name)
    created = client.get_hull(name).info
    client.apply(name, insert=SQUARE)
    hull = client.get_hull(name)
    assert created.created - timedelta(seconds=1) < created.changed <= hull.info.changed
    with client.watch_many(names=[name]) as many, client.watch(name, measures=True) as watch:
        state, event = next(many), next(watch)
        assert hull.measures == state.measures == event.measures
        assert hull.info.changed == state.changed == event.changed
        client.apply(name, insert=[[9, 9]])
        event = next(watch)
        assert client.get_hull(name).info.changed == event.changed >= state.changed
    assert client.series(name).changed_times[-1] == np.datetime64(event.changed.replace(tzinfo=None))


def test_an_outline_within_an_error(client: HullClient, name: str) -> None:
    angles = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    client.create_hull(name)
    client.apply(name, insert=np.c_[np.cos(angles), np.sin(angles)])
    with client.watch_many(names=[name], contents="outline", max_vertices=8) as watch:
        state = next(watch)
    assert state.vertices is not None
    assert len(state.vertices) <= 8
    assert 0 < state.error < 0.3
    assert state.vertex_count == 60


def test_names_that_come_later(client: HullClient, name: str) -> None:
    with client.watch_many(names=[f"{name}/later", f"{name}/never"]) as watch:
        assert said(until(watch, "complete")) == [("complete", "", 0)]
        client.create_hull(f"{name}/other")
        client.create_hull(f"{name}/later")
        assert said(until(watch, "position")) == [("state", f"{name}/later", 0)]


def test_a_watch_goes_on_where_it_was(client: HullClient, name: str) -> None:
    """Deleted and made again between two watches, it is told apart; what has not changed is named."""
    for part in "abcd":
        client.create_hull(f"{name}/{part}")
        client.apply(f"{name}/{part}", insert=SQUARE)
    copies = HullCopies()
    with client.watch_many(f"{name}/", copies=copies) as watch:
        until(watch, "complete")
        client.apply(f"{name}/b", insert=[[5, 5]])  # of the last commit of a position it is not known who has more
        until(watch, "position")
    client.apply(f"{name}/a", insert=[[9, 9]])
    client.delete_hull(f"{name}/c")
    client.delete_hull(f"{name}/d")
    client.create_hull(f"{name}/d")
    with client.watch_many(f"{name}/", position=copies.position) as watch:
        again = until(watch, "complete")
    assert ("unchanged", f"{name}/b", 0) in said(again) or ("state", f"{name}/b", 2) in said(again)
    with client.watch_many(f"{name}/", copies=copies) as watch:
        changes = said(until(watch, "complete"))
    assert ("gone", f"{name}/c", 0) in changes
    assert ("state", f"{name}/a", 2) in changes
    assert held(copies) == states(client, f"{name}/")


RUNS = count()
STEPS = st.lists(st.tuples(st.sampled_from(["apply", "create", "delete", "resume", "read"]), st.integers(0, 3)))


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=6)
@given(STEPS)
def test_copies_end_with_what_the_server_has(client: HullClient, name: str, steps: list[tuple[str, int]]) -> None:
    prefix = f"{name}/{next(RUNS)}/"
    copies = HullCopies()
    watch: ManyWatch = client.watch_many(prefix, copies=copies, max_rate=1000)
    there: set[str] = set()
    last: dict[str, tuple[str, int]] = {}
    for step, number in steps:
        hull = f"{prefix}{number}"
        if step == "create" and hull not in there:
            client.create_hull(hull)
            there.add(hull)
        elif step == "apply" and hull in there:
            client.apply(hull, insert=[[len(last), number]])
        elif step == "delete" and hull in there:
            client.delete_hull(hull)
            there.discard(hull)
        elif step == "resume":
            watch.close()
            watch = client.watch_many(prefix, copies=copies, max_rate=1000)
        elif step == "read":
            until(watch, "complete" if copies.position is None else "position")
            for each, copy in copies.items():
                before = last.get(each, ("", 0))
                assert before[0] != copy.uid or before[1] <= copy.revision
                last[each] = copy.uid, copy.revision
    watch.close()
    with client.watch_many(prefix, copies=copies) as watch:
        until(watch, "complete")
    assert held(copies) == states(client, prefix)


def test_kill_9_and_restart(tmp_path: Path) -> None:
    copies = HullCopies()
    with server_process("--data", str(tmp_path / "data"), killed=True) as server, HullClient(server.address) as client:
        for part in "abc":
            client.create_hull(part)
            client.apply(part, insert=SQUARE)
        with client.watch_many(copies=copies) as watch:
            until(watch, "complete")
        client.apply("a", insert=[[9, 9]])
        client.delete_hull("b")
        client.create_hull("new")
        server.process.send_signal(signal.SIGKILL)
        server.process.wait()
    with server_process("--data", str(tmp_path / "data")) as server, HullClient(server.address) as client:
        with client.watch_many(copies=copies) as watch:
            kinds = {each.kind for each in until(watch, "complete")}
        assert "restored" not in kinds
        assert held(copies) == states(client, "")


def test_a_restored_server_is_pictured_anew(tmp_path: Path) -> None:
    data, copy, copies = tmp_path / "data", tmp_path / "copy", HullCopies()
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        client.create_hull("a")
        client.apply("a", insert=SQUARE)
    assert dynhull("backup", copy, "--data", data).exit_code == 0
    with server_process("--data", str(data)) as server, HullClient(server.address) as client:
        client.apply("a", insert=[[9, 9]])
        client.create_hull("b")
        with client.watch_many(copies=copies) as watch:
            until(watch, "complete")
    assert dynhull("restore", copy, "--data", tmp_path / "back").exit_code == 0
    with server_process("--data", str(tmp_path / "back")) as server, HullClient(server.address) as client:
        with client.watch_many(copies=copies) as watch:
            changes = until(watch, "complete")
        assert changes[0].kind == "restored"
        assert ("gone", "b", 0) in said(changes)
        assert held(copies) == states(client, "")


def test_asyncio(address: str, name: str) -> None:
    async def follow() -> None:
        async with AsyncHullClient(address) as client:
            await client.create_hull(f"{name}/a")
            async with client.watch_many(f"{name}/") as watch:
                kinds = [(await anext(watch)).kind for _ in range(2)]
                assert kinds == ["state", "complete"]

    asyncio.run(follow())


@pytest.mark.parametrize(
    ("request_", "field"),
    [
        (pb.WatchManyRequest(prefix="a b"), "prefix"),
        (pb.WatchManyRequest(prefix="a", names=["b"]), "names"),
        (pb.WatchManyRequest(names=["a", "b c"]), "names"),
        (pb.WatchManyRequest(position=b"123"), "position"),
        (pb.WatchManyRequest(max_vertices=3), "max_vertices"),
        (pb.WatchManyRequest(max_vertices=1001, contents=pb.HULL_CONTENTS_OUTLINE), "max_vertices"),
        (pb.WatchManyRequest(contents=9), "contents"),  # type: ignore[arg-type]
        (pb.WatchManyRequest(max_events_per_second=-1), "max_events_per_second"),
    ],
    ids=str,
)
def test_refused(address: str, request_: pb.WatchManyRequest, field: str) -> None:
    with grpc.insecure_channel(address) as channel:
        _, info, _ = refusal(lambda: list(HullServiceStub(channel).WatchMany(request_)))
    assert info.metadata["field"] == field


def test_arguments_that_exclude_each_other(client: HullClient) -> None:
    for options in (
        {"prefix": "a", "names": ["b"]},
        {"names": []},
        {"contents": "all"},
        {"contents": "summary", "copies": HullCopies()},
        {"max_vertices": 3, "copies": HullCopies()},
        {"position": b"", "copies": HullCopies()},
    ):
        with pytest.raises(ValueError, match=r"names|contents|copies"):
            client.watch_many(**options)
    with pytest.raises(InvalidRequestError, match="position"):
        next(client.watch_many(position=b"1"))
