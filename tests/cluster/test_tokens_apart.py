"""Servers of a cluster that have files of tokens of their own: that of a hull's owner holds wherever a call came in."""

from contextlib import ExitStack
from pathlib import Path

import pytest
from one_gateway import entries
from patience import wait_until
from postgresql import PostgreSQL, query
from server_process import server_process

from dynhull_client import Circle, HullClient, HullCopy, UnauthenticatedError
from dynhull_cluster.placement import worker_of

pytestmark = pytest.mark.one_process("a cluster has a shape of its own")

OWNERS = "SELECT partition, worker FROM owners WHERE until > '-infinity' AND address <> ''"


def test_a_token_that_is_taken_away_where_the_hull_is_ends_what_came_through_others(
    postgres: PostgreSQL, tmp_path: Path
) -> None:
    url = postgres.new_database()
    files = [tmp_path / "front.toml", tmp_path / "owner.toml"]
    for each in files:
        each.write_text(entries("one", "two"))
    options = ("--cluster", "--partitions", "2", "--journal", url, "--scrub-cpu", "0", "--log-level", "error")
    with ExitStack() as stack:
        front, owner = (stack.enter_context(server_process(*options, "--tokens", str(each))) for each in files)
        wait_until(lambda: len({worker for _, worker in query(url, OWNERS)}) == 2)
        (partition,) = (each for each, worker in query(url, OWNERS) if f"-{owner.process.pid}-" in worker)
        first = next(each for each in "abcdefgh" if worker_of(each, 2) == partition)
        hull, fence = f"{first}/hull", f"{first}/fence"
        one, two = (stack.enter_context(HullClient(front.address, token=each)) for each in ("one", "two"))
        one.create_hull(hull, keyed="str")
        one.create_fence(fence, area=Circle(0, 0, 2), subjects=hull)
        ours = stack.enter_context(one.watch(hull)), stack.enter_context(one.watch_fence(fence))
        next(ours[0])
        copy = HullCopy()
        theirs = {
            "watch": two.watch(hull, copy=copy),
            "limited watch": two.watch(hull, max_rate=0.01),
            "watch with keys": two.watch(hull, keys=True),
            "fence": two.watch_fence(fence),
            "consumer": two.watch_fence(fence, consumer="c"),
        }
        for each in theirs.values():
            stack.enter_context(each)
        for each in ("watch", "limited watch", "watch with keys"):
            next(theirs[each])
        one.put(hull, ["a"], [[1, 0]])
        assert next(ours[0]).revision == next(theirs["watch"]).revision == 1
        entered = next(ours[1])
        files[1].write_text(entries("one"))
        for each in theirs.values():
            with pytest.raises(UnauthenticatedError):
                list(each)
        assert one.put(hull, ["a"], [[5, 0]]).revision == 2
        assert next(ours[0]).revision == 2
        assert next(ours[1]).sequence == entered.sequence + 1
        for begun in (two.watch(hull, copy=copy), two.watch_fence(fence, after=0)):  # what others of this gateway have
            with begun, pytest.raises(UnauthenticatedError):
                next(begun)
