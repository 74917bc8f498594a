"""Which worker should have which partition: a function of what the tables say, so that all workers agree on it."""

from collections import Counter
from collections.abc import Collection, Mapping, Sequence


def shares(holders: Sequence[str], workers: Collection[str], wishes: Mapping[int, str]) -> list[str]:
    """Who should have each partition: as many for each worker, to within one, and as few moves as that takes.

    Args:
        holders: who has each partition; empty for nobody.
        workers: the workers that can have some.
        wishes: partitions, and the workers that should have them in any case; of other workers they are void.

    Returns:
        A worker for each partition; empty for all of them without workers.
    """
    if not workers:
        return [""] * len(holders)
    found = [wish if (wish := wishes.get(each, "")) in workers else "" for each in range(len(holders))]
    left = [each for each, worker in enumerate(found) if not worker]
    counts = Counter(dict.fromkeys(workers, 0))
    counts.update(filter(None, found))
    most = _most(counts, Counter(holders[each] for each in left), len(left))
    for partition in left:
        holder = holders[partition]
        if holder in counts and counts[holder] < most[holder]:
            found[partition] = holder
            counts[holder] += 1
    for partition in left:
        if not found[partition]:
            found[partition] = min(counts, key=lambda each: (counts[each] - most[each], each))
            counts[found[partition]] += 1
    return found


def _most(wished: Mapping[str, int], held: Mapping[str, int], left: int) -> dict[str, int]:
    """How many partitions each worker should have, if some are wished and others held already.

    Those that are left level out what is wished; where they do not divide evenly, who holds more keeps more.
    """
    most = dict(wished)
    for _ in range(left):
        most[min(most, key=lambda each: (most[each], most[each] - wished[each] - held.get(each, 0), each))] += 1
    return most
