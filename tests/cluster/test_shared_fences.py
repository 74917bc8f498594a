"""Many watches of a fence at a gateway: the worker has one, and each watcher gets every event, once and in order."""

import threading
from collections.abc import Iterable

import grpc
import numpy as np
import pytest
from cases import slow
from one_gateway import Place, entries
from patience import wait_until

from dynhull_client import HullClient, UnauthenticatedError
from dynhull_proto.v1 import fence_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub

SQUARE = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]
METHOD = "WatchFence"


def fenced(client: HullClient, name: str) -> None:
    """A hull of keys, and a fence of that name around a part of the plane."""
    client.create_hull(name, keyed="int")
    client.create_fence(name, area=SQUARE, subjects=name, initial="none")


def cross(client: HullClient, name: str, times: int, keys: int = 1) -> None:
    """Let keys enter and exit: an event for each key and time."""
    for i in range(times):
        client.put(name, list(range(keys)), np.full((keys, 2), 1.0 if i % 2 == 0 else 9.0))


class Follower:
    """A thread that notes the sequences of the events that it gets, up to one."""

    def __init__(self, client: HullClient, name: str, last: int, **options: object) -> None:
        self.seen: list[int] = []
        self._last = last
        self._watch = client.watch_fence(name, reconnect=False, **options)
        self._thread = threading.Thread(target=self._read)
        self._thread.start()

    def _read(self) -> None:
        for event in self._watch:
            if event.type != "progress":
                self.seen.append(event.sequence)
            if self.seen and self.seen[-1] >= self._last:
                return

    def wait(self) -> None:
        self._thread.join()

    def leave(self) -> None:
        self._watch.close()


@slow
def test_everybody_gets_every_event_once(place: Place, client: HullClient) -> None:
    fenced(client, "all")
    cross(client, "all", 10)
    place.wait_for(0)
    followers = [Follower(client, "all", 90, after=after) for after in (0, 0, 3, 10, None, None)]
    place.wait_for(1)
    cross(client, "all", 40)
    late = [Follower(client, "all", 90, after=after) for after in (0, 25, 50)]
    cross(client, "all", 40)
    for each in followers + late:
        each.wait()
    assert place.costs(METHOD)[0] == 1
    for each in followers + late:
        each.leave()
    new = [each.seen[0] - 1 for each in followers[4:]]  # they begin with the next event, whenever they begin
    begun = (0, 0, 3, 10, *new, 0, 25, 50)
    assert min(new) >= 10
    assert [each.seen for each in followers + late] == [list(range(after + 1, 91)) for after in begun]


def test_what_is_of_its_own_stays_so(place: Place, client: HullClient) -> None:
    """Consumers, limited and conflated watches, and marks of progress, which are a feed of their own."""
    fenced(client, "own")
    options = ({"consumer": "one"}, {"max_rate": 1000}, {"conflate": True, "after": 0}, {"progress_interval": 0.01})
    followers = [Follower(client, "own", 1, **each) for each in options]
    place.wait_for(4)
    cross(client, "own", 1)
    for each in followers:
        each.wait()
        each.leave()
        assert each.seen == [1]


@slow
def test_a_watcher_that_does_not_read_holds_nobody(place: Place, client: HullClient) -> None:
    """It gets what the feed has forgotten from the worker, and goes on with the feed."""
    keys, times = 400, 100
    fenced(client, "slow")
    with grpc.insecure_channel(place.address, [("grpc.http2.bdp_probe", 0)]) as channel:
        request, metadata = pb.WatchFenceRequest(name="slow"), [("authorization", "Bearer one")]
        slow = FenceServiceStub(channel).WatchFence(request, metadata=metadata)
        assert next(slow).sequence == 0
        place.wait_for(1)
        before = place.costs(METHOD)[1]
        fast = Follower(client, "slow", keys * times, after=0)  # the first events may come before it has begun
        cross(client, "slow", times, keys)  # responses of 20 kB
        fast.wait()
        seen = sequences(slow, keys * times)
        wait_until(lambda: place.costs(METHOD)[1] >= before + 2)  # the second one was to catch up
        place.wait_for(1)
        cross(client, "slow", 1, keys)
        seen += sequences(slow, keys * (times + 1))
        slow.cancel()
    fast.leave()
    assert fast.seen == list(range(1, keys * times + 1))
    assert seen == list(range(1, keys * (times + 1) + 1))


def sequences(responses: Iterable[pb.WatchFenceResponse], last: int) -> list[int]:
    found: list[int] = []
    for response in responses:
        found += [event.sequence for event in response.events]
        if response.sequence >= last:
            break
    return found


def test_a_deleted_fence_ends_every_watch_with_its_last_event(place: Place, client: HullClient) -> None:
    fenced(client, "gone")
    watches = [client.watch_fence("gone") for _ in range(5)]
    place.wait_for(1)
    client.delete_fence("gone")
    for each in watches:
        assert [event.type for event in each] == ["closed"]


def test_a_token_that_is_taken_away_ends_its_watches_alone(place: Place, client: HullClient) -> None:
    fenced(client, "tokens")
    with HullClient(place.address, token="two") as other:
        theirs, ours = other.watch_fence("tokens"), client.watch_fence("tokens")
        place.wait_for(1)
        place.tokens.write_text(entries("one"))
        with pytest.raises(UnauthenticatedError):
            next(theirs)
        cross(client, "tokens", 1)
        assert next(ours).sequence == 1
        ours.close()
    place.tokens.write_text(entries("one", "two"))
