"""Which names share a queue, and in which order requests wait when queues are joined."""

from collections import Counter
from collections.abc import Iterable, Sequence

from ...requests import Request, Together
from ..model.fence import Fence
from ..model.requests import PREFIX, FenceRequest

# Requests that may wait in several queues.
SPANNING = Together | FenceRequest


def components(names: Sequence[str], fences: Iterable[Fence]) -> list[tuple[list[str], list[Fence]]]:
    """Groups of names that fences join, each with these fences; a name that no fence concerns is alone.

    Args:
        names: names of hulls, and of the queues of fences.
        fences: the fences; the hulls that they depend on are among the names.
    """
    first = {name: name for name in names}

    def find(name: str) -> str:
        while first[name] != name:
            first[name] = name = first[first[name]]
        return name

    fences = list(fences)
    for fence in fences:
        key = find(PREFIX + fence.name)
        for name in depends_on(fence):
            first[find(name)] = find(key)
        if fence.row.config.kind == "prefix":
            prefix = fence.row.config.subjects
            for name in names:
                if name.startswith(prefix):
                    first[find(name)] = find(key)
            for other in fences:  # a hull may come that both compare
                if overlap(fence, other):
                    first[find(PREFIX + other.name)] = find(key)
    groups: dict[str, tuple[list[str], list[Fence]]] = {}
    for name in names:
        groups.setdefault(find(name), ([], []))[0].append(name)
    for fence in fences:
        groups[find(PREFIX + fence.name)][1].append(fence)
    return list(groups.values())


def depends_on(fence: Fence) -> list[str]:
    """The names of the hulls that a fence depends on."""
    hulls = [] if fence.pair is None else [fence.pair.other.name]
    watched = () if fence.watched is None else fence.watched.of
    return [*fence.subjects, *hulls, *watched, *([] if fence.area is None else [fence.area.name])]


def overlap(one: Fence, other: Fence) -> bool:
    """Whether a name can have the prefixes of both fences."""
    a, b = one.row.config, other.row.config
    if a.kind != "prefix" or b.kind != "prefix":
        return False
    return a.subjects.startswith(b.subjects) or b.subjects.startswith(a.subjects)


def merged(queues: Sequence[list[Request]]) -> list[Request]:
    """The requests of some queues in one order that is that of each of them. O(requests * queues).

    A request that waits in several of the queues comes once. Requests that may wait in other queues too keep the order
    in which they have arrived, because it is their order there.
    """
    queues = [queue for queue in queues if queue]
    if len(queues) == 1:
        return list(queues[0])
    places = Counter(id(request) for queue in queues for request in queue)
    at = [0] * len(queues)
    ordered: list[Request] = []
    while True:
        fronts: dict[int, list[int]] = {}
        for number, queue in enumerate(queues):
            while at[number] < len(queue) and not isinstance(queue[at[number]], SPANNING):
                ordered.append(queue[at[number]])
                at[number] += 1
            if at[number] < len(queue):
                fronts.setdefault(id(queue[at[number]]), []).append(number)
        if not fronts:
            return ordered
        # The oldest one is in front of all queues in which it waits.
        ready = [numbers for key, numbers in fronts.items() if places[key] == len(numbers)]
        first = min(ready, key=lambda numbers: queues[numbers[0]][at[numbers[0]]].order)  # type: ignore[attr-defined]
        ordered.append(queues[first[0]][at[first[0]]])
        for number in first:
            at[number] += 1
