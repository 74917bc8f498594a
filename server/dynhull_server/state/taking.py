"""Which of the requests that wait make the next trip together."""

from collections.abc import Callable

from .fences.index.components import SPANNING
from .fences.model.requests import STRUCTURAL, CreateFence, DeleteFence, FenceRequest
from .queues import Queue, Queues, names_of
from .requests import DeleteHull, Request, Together, WriteBatch

# The most points that the requests of one trip read or write together, unless a single request exceeds it.
TRIP_ROWS = 2**18
# The most fences that one trip creates or deletes, and the most corners of their areas, unless one alone has more.
FENCES_TOGETHER, CORNERS_TOGETHER = 64, 2**14


def take(all_queues: Queues, queues: list[Queue]) -> tuple[list[Request], int]:
    """The requests of the next trip to some queues, and their points.

    The queues of further fences that the trip creates are added to `queues`.
    """
    first = queues[0].waiting[0]
    if len(queues) == 1:
        return _take_alone(queues[0], lambda request: len(all_queues.at(names_of(request))) > 1)
    if isinstance(first, CreateFence):
        return _take_creations(all_queues, queues, first)
    if isinstance(first, FenceRequest) or any(queue.line is not None for queue in queues):
        requests = [queue.waiting.pop(0) for queue in queues][:1]
        return requests, requests[0].rows
    return _take_together(queues)


def _take_creations(all_queues: Queues, queues: list[Queue], first: CreateFence) -> tuple[list[Request], int]:
    """A request to create a fence, and those behind it that create others around the same hulls.

    The queues of the others are added to `queues`.
    """
    taken: list[CreateFence] = []
    own, *shared = all_queues.at(first.names)
    corners, following = 0, first
    while True:
        taken.append(following)
        corners += following.config.corners
        for queue in all_queues.at(following.names):
            del queue.waiting[0]
        if own.line is not None or first.config.kind == "prefix" or len(taken) == FENCES_TOGETHER:
            break
        candidate = shared[0].waiting[0] if shared[0].waiting else None
        if not isinstance(candidate, CreateFence) or candidate.config.kind == "prefix":
            break
        following, (its_own, *others) = candidate, all_queues.at(candidate.names)
        if its_own in queues or its_own.line is not None or its_own.trip is not None or set(others) != set(shared):
            break
        if any(not queue.waiting or queue.waiting[0] is not candidate for queue in (its_own, *others)):
            break
        if corners + candidate.config.corners > CORNERS_TOGETHER:
            break
        queues.append(its_own)
    return list(taken), max(request.rows for request in taken)


def _take_alone(queue: Queue, spans: Callable[[Request], bool]) -> tuple[list[Request], int]:
    """The requests of the next trip, and their points: at most TRIP_ROWS.

    A DeleteHull is always alone, and so are requests that change lines, but some that delete different fences run
    together. Requests to several hulls stay if they wait in other queues too, which `spans` decides.
    """
    waiting, queue.waiting = queue.waiting, []
    requests: list[Request] = []
    rows = 0
    deleted: set[str] = set()
    for i, request in enumerate(waiting):
        if request.abandoned or (type(request) is WriteBatch and request.stream and request.stream.stopped):
            continue
        alone = type(request) is DeleteHull or isinstance(request, STRUCTURAL)
        if type(request) is DeleteFence:
            joins = len(requests) == len(deleted) < FENCES_TOGETHER and request.name not in deleted
        else:
            joins = not (alone or deleted)
        stays = isinstance(request, SPANNING) and spans(request)
        if stays or (requests and not (joins and rows + request.rows <= TRIP_ROWS)):
            queue.waiting = waiting[i:]
            break
        requests.append(request)
        rows += request.rows
        if type(request) is DeleteFence:
            deleted.add(request.name)
        elif alone:
            queue.waiting = waiting[i + 1 :]
            break
    return requests, rows


def _take_together(queues: list[Queue]) -> tuple[list[Request], int]:
    """The requests of the next trip to these hulls, the first ones in all of their queues, and their points."""
    requests: list[Request] = []
    rows = 0
    for request, *others in zip(*(queue.waiting for queue in queues), strict=False):
        if not isinstance(request, Together) or len(request.parts) != len(queues):
            break
        if any(other is not request for other in others) or (requests and rows + request.rows > TRIP_ROWS):
            break
        requests.append(request)
        rows += request.rows
    for queue in queues:
        del queue.waiting[: len(requests)]
    return requests, rows
