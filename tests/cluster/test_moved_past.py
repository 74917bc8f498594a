"""The past of hulls whose owners change: it is whole, whoever has written it, and whoever reads it."""

from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest
from cases import slow, with_all_cases
from command_line import dynhull
from patience import wait_until
from postgresql import PostgreSQL, query
from server_process import Server, run, server_process

from dynhull_client import HullClient

NAMES = [f"{first}/fleet" for first in "abcd"]
KEYS = [f"vehicle {i}" for i in range(20)]
QUIET = ("--scrub-cpu", "0", "--log-level", "error", "--snapshot-points", "100")
SERVED = "SELECT count(*) FROM owners WHERE until > '-infinity' AND address <> '' GROUP BY worker"
CLOSING = "SELECT count(*) FROM segments WHERE hull = 0"  # files that are named, and belong to no segment yet
MOVES = 4
EACH = 7  # batches between two looks


def positions(revision: int) -> np.ndarray:
    return np.round(np.random.default_rng(revision).random((len(KEYS), 2)), 7)


def write(client: HullClient, filed: int) -> int:
    """Write to all hulls until so many batches of each are in segments. The last revision of all."""
    last = client.get_hull(NAMES[0]).info.revision

    def enough() -> bool:
        nonlocal last
        for _ in range(EACH):
            last += 1
            for name in NAMES:
                assert client.put(name, KEYS, positions(last), producer="p", sequence=last).revision == last
        return all(client.history(name).batches >= filed for name in NAMES)

    wait_until(enough)
    return last


def check(client: HullClient, last: int) -> None:
    """Each revision is there, in the feed and as of some of them, by number and by time."""
    for name in NAMES:
        assert client.history(name).first_revision == 0
        with client.feed(name, after=0) as feed:
            for revision in range(1, last + 1):
                batch = next(feed)
                assert (batch.revision, list(batch.keys)) == (revision, KEYS)
                np.testing.assert_array_equal(batch.points, positions(revision))
        for revision in range(1, last + 1, max(1, last // 5)):
            past = client.at(name, revision)
            np.testing.assert_array_equal(past.positions(KEYS).positions, positions(revision))


@with_all_cases
@pytest.mark.one_process("a cluster has a shape of its own")
def test_owners_that_come_and_go_leave_the_past_whole(postgres: PostgreSQL, tmp_path: Path) -> None:
    url = postgres.new_database()

    def machine(**expected: bool) -> AbstractContextManager[Server]:
        options = "--cluster", "--partitions", "4", "--journal", url, "--history-dir", str(tmp_path)
        return server_process(*options, *QUIET, **expected)

    with machine() as first, HullClient(first.address, retries=1000) as client:
        for name in NAMES:
            client.create_hull(name, keyed="str", history=True)
        write(client, 1)
        with machine() as second, HullClient(second.address, retries=1000) as other:
            wait_until(lambda: sorted(count for (count,) in query(url, SERVED)) == [2, 2])
            last = write(other, client.history(NAMES[0]).batches + 2 * EACH)
            check(other, last)
            check(client, last)
            first.process.terminate()
            last = write(other, other.history(NAMES[0]).batches + 1)
            first.process.wait()
            check(other, last)


@slow
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_partition_that_moves_again_and_again_while_segments_close_keeps_the_past(
    postgres: PostgreSQL, tmp_path: Path
) -> None:
    url = postgres.new_database()
    options = "--cluster", "--partitions", "1", "--journal", url, "--history-dir", str(tmp_path), *QUIET
    with (
        server_process(*options) as first,
        server_process(*options) as second,
        HullClient(first.address, retries=1000) as client,
        HullClient(second.address, retries=1000) as other,
    ):
        for name in NAMES:
            client.create_hull(name, keyed="str", history=True)
        wait_until(lambda: len(query(url, "SELECT worker FROM workers")) == 2)
        last = 0

        def closes() -> bool:
            nonlocal last
            last += 1
            for name in NAMES:
                client.put(name, KEYS, positions(last), producer="p", sequence=last)
            return query(url, CLOSING)[0][0] > 0

        for _ in range(MOVES):
            wait_until(closes)
            ((owner,),) = query(url, "SELECT worker FROM owners")
            (target,) = {name for (name,) in query(url, "SELECT worker FROM workers")} - {owner}
            assert dynhull("cluster", "move", "0", target, "--journal", url).exit_code == 0
            wait_until(lambda target=target: query(url, "SELECT worker FROM owners") == [(target,)])
        last = write(other, other.history(NAMES[0]).batches + 1)
        check(client, last)
        check(other, last)


@slow
@pytest.mark.parametrize(
    "shape", [(), pytest.param(("--cluster", "--partitions", "1"), marks=slow)], ids=["alone", "cluster"]
)
@pytest.mark.one_process("a cluster has a shape of its own")
def test_a_copy_of_a_database_is_refused_where_the_past_of_the_original_is(
    postgres: PostgreSQL, tmp_path: Path, shape: tuple[str, ...]
) -> None:
    url = postgres.new_database()
    options = *shape, "--history-dir", str(tmp_path / "past")
    for _ in range(2):
        with server_process(*options, "--journal", url, *QUIET) as server, HullClient(server.address) as client:
            client.create_hull("fleet", keyed="str", history=True, exist_ok=True)
    copy = postgres.restored_copy(url, tmp_path)
    done = run("serve", "--port", "0", "--journal", copy, *options)
    assert done.returncode != 0
    assert "has the past of another database, " in done.stderr


@with_all_cases
def test_a_move_between_a_folder_and_a_database_takes_the_past_along(postgres: PostgreSQL, tmp_path: Path) -> None:
    data, back, history = (str(tmp_path / each) for each in ("data", "back", "past"))
    url = postgres.new_database()
    with server_process("--data", data, *QUIET) as server, HullClient(server.address) as client:
        for name in NAMES:
            client.create_hull(name, keyed="str", history=True)
        last = write(client, EACH)
    moved = dynhull("move", data, url, "--history-dir", history)
    assert moved.exit_code == 0, moved.output
    options = "--journal", url, "--history-dir", history, *QUIET
    with server_process(*options) as server, HullClient(server.address) as client:
        check(client, last)
        last = write(client, last + 1)
        check(client, last)
    moved = dynhull("move", url, back, "--history-dir", history)
    assert moved.exit_code == 0, moved.output
    with server_process("--data", back, *QUIET) as server, HullClient(server.address) as client:
        check(client, last)
