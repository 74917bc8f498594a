"""Watches of the outline alone: an event when it changes, and marks."""

from pathlib import Path

import pytest
from metrics import measured, scrape
from patience import wait_until
from server_process import server_process
from set_time import SetTime

from dynhull_client import Change, Deleted, HullClient, HullCopy, HullNotFoundError, Progress, Sketch, Snapshot

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]


@pytest.fixture
def client(address: str, name: str):
    with HullClient(address) as client:
        client.create_hull(name)
        client.apply(name, insert=SQUARE)
        yield client


def inner(client: HullClient, name: str, count: int) -> int:
    """Batches that leave the outline as it is; returns the revision after them."""
    with client.ingest(name) as stream:
        for _ in range(count):
            stream.apply(insert=[[1, 1], [2, 2]])
    return stream.summary.revision


def test_only_changes_of_the_outline_are_events(client: HullClient, name: str) -> None:
    copy = HullCopy()
    with client.watch(name, copy=copy, outline=True) as watch:
        assert type(next(watch)) is Snapshot
        for side in range(5, 9):
            revision = inner(client, name, 20)
            revision = client.apply(name, insert=[[side, side]]).revision
            event = next(watch)
            assert (type(event), event.revision) == (Change, revision)
            assert copy.vertices.tolist() == client.get_hull(name).vertices.tolist()
            assert copy.points == client.get_hull(name).info.points


def test_a_vertex_that_leaves_and_one_with_copies(client: HullClient, name: str) -> None:
    with client.watch(name, outline=True) as watch:
        next(watch)
        client.apply(name, insert=[[4, 4]])
        client.apply(name, delete=[[4, 4]])
        client.apply(name, delete=[[4, 4]])
        event = next(watch)
        assert (event.revision, event.removed.tolist()) == (4, [[4, 4]])


def test_marks_say_how_far_nothing_has_changed(client: HullClient, name: str) -> None:
    copy = HullCopy()
    with client.watch(name, copy=copy, outline=True, progress_interval=0.05) as watch:
        next(watch)
        revision = inner(client, name, 30)
        marks = []
        while copy.revision < revision:
            marks.append(next(watch))
        assert {type(each) for each in marks} == {Progress}
        assert copy.points == 4 + 60
        quiet = [next(watch) for _ in range(3)]
        assert {(type(each), each.revision) for each in quiet} == {(Progress, revision)}
    with client.watch(name, outline=True, progress_interval=3600) as watch:
        next(watch)
        inner(client, name, 30)
        client.apply(name, insert=[[9, 9]])
        assert type(next(watch)) is Change  # a batch alone makes no mark


def test_sketches_and_names(client: HullClient, name: str) -> None:
    with client.watch(name, directions=[[1, 0], [0, 1]], outline=True) as watch:
        next(watch)
        inner(client, name, 5)
        client.apply(name, insert=[[-9, -9]])  # another outline with the same extremes
        client.apply(name, insert=[[9, 0]])
        event = next(watch)
        assert (type(event), event.revision) == (Sketch, 8)
    keyed = f"{name}/keys"
    client.create_hull(keyed, keyed="int")
    client.put(keyed, [5, 6, 7], [[0, 0], [4, 0], [0, 4]])
    copy = HullCopy()
    with client.watch(keyed, copy=copy, keys=True, outline=True) as watch:
        next(watch)
        client.put(keyed, [9], [[4, 0]])  # the least key of a place names it
        client.put(keyed, [1], [[0, 4]])
        event = next(watch)
        assert (event.revision, event.renamed_keys) == (3, (1,))
        assert copy.vertex_keys == (5, 6, 1)


def test_resuming_and_deletion(client: HullClient, name: str) -> None:
    copy = HullCopy()
    with client.watch(name, copy=copy, outline=True) as watch:
        next(watch)
    inner(client, name, 3)
    client.apply(name, insert=[[9, 9]])
    with client.watch(name, copy=copy, outline=True, follow=True) as watch:
        event = next(watch)
        assert (type(event), event.revision) == (Change, 5)
        client.delete_hull(name)
        assert type(next(watch)) is Deleted
    client.create_hull(name)
    with client.watch(name, outline=True) as watch:
        next(watch)
        client.delete_hull(name)
        with pytest.raises(HullNotFoundError):
            next(watch)


def test_points_that_leave_by_themselves_change_the_outline(tmp_path: Path) -> None:
    clock = SetTime(tmp_path)
    with server_process(wrap=clock.wrap) as server, HullClient(server.address) as client:
        client.create_hull("a", max_age=3600)
        watch = client.watch("a", outline=True)
        next(watch)
        client.apply("a", insert=SQUARE)
        assert len(next(watch).added) == 4
        clock.passes(3600)
        event = next(watch)
        assert (event.cause, len(event.removed)) == ("expiry", 4)
        watch.close()


def test_many_watchers_cost_nothing_while_the_outline_stays() -> None:
    watchers = 200
    with measured("--scrub-cpu", "0") as (server, address), HullClient(server.address) as client:
        client.create_hull("a")
        client.apply("a", insert=SQUARE)
        watches = [client.watch("a", outline=True) for _ in range(watchers)]
        for each in watches:
            next(each)

        def sent() -> float:
            return sum(
                value for name, value in scrape(address).items() if name.startswith("dynhull_watch_events_total")
            )

        wait_until(lambda: sent() == watchers)  # an event is counted after it was sent
        inner(client, "a", 300)
        assert sent() == watchers
        client.apply("a", insert=[[9, 9]])
        assert {next(each).revision for each in watches} == {302}
        for each in watches:
            each.close()
