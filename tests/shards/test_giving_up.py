"""Requests that are refused because a shard is away have not happened, and those that nobody waits for are dropped."""

import numpy as np
from shards.memory_logs import Cluster
from shards.workload import LIMITS

from dynhull_cluster.shards.messages import SampleOf
from dynhull_cluster.shards.requests import Read, Reshard, RootWrite
from dynhull_server.state.batch import NO_POINTS, Batch, Write
from dynhull_server.state.errors import ShardAwayError
from dynhull_server.state.records import HullSettings
from dynhull_server.state.requests import Stream, WriteBatch

POINTS = np.array([(x, y) for x in range(4) for y in range(4)], float)


def of_points(points, stream=None):
    write = Write("hull", Batch(points, NO_POINTS, 0, count_missing=False), 0, len(points))
    return RootWrite(WriteBatch(None, write, stream=stream), now=0.0)


def test_what_is_given_up_has_not_happened():
    cluster = Cluster(HullSettings(), LIMITS, 2)
    cluster.serve(of_points(POINTS[:1]))
    begun, waiting = of_points(POINTS), of_points(POINTS)
    cluster.root.submit(begun)
    cluster.root.submit(waiting)
    (place, message), _ = cluster.root.messages()
    cluster.root.receive(place, cluster.receive(place, message))  # the other one is away
    cluster.root.give_up(ShardAwayError("hull", 1))
    assert [type(each.error) for each in (begun, waiting)] == [ShardAwayError] * 2
    assert not cluster.root.waits
    late = of_points(POINTS[:2])
    cluster.root.submit(late)
    cluster.root.give_up(ShardAwayError("hull", 1))  # while the shards are being opened
    assert isinstance(late.error, ShardAwayError)
    cluster.deliver()
    assert cluster.serve(of_points(POINTS[1:3])).result.revision == 2
    _, points = cluster.serve(Read(SampleOf(100))).result
    assert np.array_equal(points, POINTS[:3])


def test_a_division_that_is_given_up_has_not_happened():
    cluster = Cluster(HullSettings(), LIMITS, 2)
    cluster.serve(of_points(POINTS))
    for rounds in range(1, 9):
        reshard = Reshard(3)
        cluster.root.submit(reshard)
        for _ in range(rounds):
            for place, message in cluster.root.messages():
                cluster.root.receive(place, cluster.receive(place, message))
        if reshard.answered:
            break
        cluster.root.give_up(ShardAwayError("hull", 2))
        assert isinstance(reshard.error, ShardAwayError)
        cluster.deliver()
        assert len(cluster.shard_logs) == 2
        revision, points = cluster.serve(Read(SampleOf(100))).result
        assert (revision, len(points)) == (1, len(POINTS))
    assert rounds > 3
    assert (reshard.result, len(cluster.shard_logs), cluster.root.points) == (2, 3, len(POINTS))


def test_a_stream_that_has_stopped_is_not_applied():
    cluster = Cluster(HullSettings(), LIMITS, 2)
    stream = Stream("hull")
    first, second = of_points(POINTS[:1]), of_points(POINTS[1:2], stream)
    third = of_points(POINTS[2:3])
    for each in (first, second, third):
        cluster.root.submit(each)
    stream.leave()
    cluster.deliver()
    assert [each.answered for each in (first, second, third)] == [True, False, True]
    assert cluster.root.points == 2


def test_another_root_serves_what_waits():
    cluster = Cluster(HullSettings(), LIMITS, 2)
    begun, waiting = of_points(POINTS[:1]), Read(SampleOf(9))
    cluster.root.submit(begun)
    cluster.root.submit(waiting)
    assert cluster.root.leave() == ([begun], [waiting])
    cluster.restart_root()
    assert cluster.serve(begun, waiting).result[0] == 1
