"""Who should have which partition: each worker works it out, so it has to be one answer, and a stable one."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from dynhull_cluster.machines.claims import shares

WORKERS = ["a", "b", "c", "d"]
SOME = st.sets(st.sampled_from(WORKERS), min_size=1)
HOLDERS = st.lists(st.sampled_from(["", *WORKERS]), min_size=1, max_size=20)
WISHES = st.dictionaries(st.integers(0, 19), st.sampled_from(WORKERS), max_size=6)


@given(HOLDERS, SOME)
def test_shares_are_even_and_no_partition_moves_in_vain(holders: list[str], workers: set[str]) -> None:
    found = shares(holders, workers, {})
    counts = Counter(found)
    assert set(counts) <= workers
    even = len(holders) // len(workers)
    assert all(counts[worker] - even in (0, 1) for worker in workers)
    stay = sum(holder == worker for holder, worker in zip(holders, found, strict=True))
    assert stay == most_that_can_stay(holders, workers)


def most_that_can_stay(holders: list[str], workers: set[str]) -> int:
    """Each worker keeps its even share, and as many as there are over keep one more."""
    even, over = divmod(len(holders), len(workers))
    held = Counter(holders)
    return sum(min(held[worker], even) for worker in workers) + min(
        over, sum(held[worker] > even for worker in workers)
    )


@given(HOLDERS, SOME, WISHES)
def test_what_has_been_done_is_not_changed_again(holders: list[str], workers: set[str], wishes: dict[int, str]) -> None:
    found = shares(holders, workers, wishes)
    assert shares(found, workers, wishes) == found


@given(HOLDERS, SOME, WISHES, st.data())
def test_moves_on_the_way_do_not_change_where_it_leads(
    holders: list[str], workers: set[str], wishes: dict[int, str], data: st.DataObject
) -> None:
    """Partitions are let go and taken one by one, and everybody works it out again at each step."""
    end = shares(holders, workers, wishes)
    now = list(holders)
    for partition in data.draw(st.permutations(range(len(holders)))):
        if now[partition] != end[partition]:
            now[partition] = data.draw(st.sampled_from(["", end[partition]]))
            assert shares(now, workers, wishes)[partition] == end[partition] or not now[partition]
    moved = sum(a != b for a, b in zip(now, shares(now, workers, wishes), strict=True))
    left = sum(a != b for a, b in zip(now, end, strict=True))
    assert moved <= left


@given(HOLDERS, SOME, WISHES)
def test_wishes_come_first(holders: list[str], workers: set[str], wishes: dict[int, str]) -> None:
    found = shares(holders, workers, wishes)
    for partition, worker in wishes.items():
        if partition < len(holders) and worker in workers:
            assert found[partition] == worker


def test_without_workers_nobody_has_any() -> None:
    assert shares(["a", ""], [], {0: "a"}) == ["", ""]


def test_a_worker_that_comes_gets_its_share_and_one_that_goes_leaves_it() -> None:
    one = shares([""] * 5, ["a"], {})
    assert one == ["a"] * 5
    two = shares(one, ["a", "b"], {})
    assert two == ["a", "a", "a", "b", "b"]
    assert shares(two, ["b"], {}) == ["b"] * 5
