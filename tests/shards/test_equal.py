"""A hull over shards gives the answers of one hull: verdicts, rows, counts, flags, vertices."""

import random
from collections import Counter

import numpy as np
import pytest
from shards.memory_logs import Cluster
from shards.workload import KINDS, LIMITS, Workload, same_effect

from dynhull_cluster.shards.messages import CountOf, PositionsOf, SampleOf, StaticHull
from dynhull_cluster.shards.requests import ExpirePoints, Read, Reshard, RootWrite
from dynhull_server.rpc.encode import CAUSES
from dynhull_server.state.batch import NO_POINTS, KeyedBatch, Write
from dynhull_server.state.errors import HullUnsuitableError, LimitExceededError
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.records import HullSettings, Kept, QuarantineRules, Window
from dynhull_server.state.requests import WriteBatch
from dynhull_server.state.sample import sample

ROUNDS = 80
# Beside the kinds of the simulation, whose seeds they would change.
EVERY = KINDS | {"times ahead refused": HullSettings("str", window=Window(max_skew=10**6), by_event_time=True)}


@pytest.mark.every(3)
@pytest.mark.parametrize("shards", [2, 5])
@pytest.mark.parametrize("kind", EVERY)
def test_a_hull_over_shards_is_one_hull(kind, shards):
    settings = EVERY[kind]
    met: Counter[str] = Counter()
    for seed in range(2):
        one = HullState(LIMITS, settings, Kept(), now=0.0)
        cluster = Cluster(settings, LIMITS, shards)
        workload, draw = Workload(settings, seed), random.Random(seed)
        for _ in range(ROUNDS):
            if draw.random() < 0.03:
                cluster.restart_root()
            if draw.random() < 0.05:
                cluster.restart_shard(draw.randrange(len(cluster.shard_logs)))
            if draw.random() < 0.08:
                met["divided in another way"] += reshard(one, cluster, draw.randint(1, 6))
            if one.contents.clock is not None and one.contents.follows_server and draw.random() < 0.2:
                workload.time += draw.choice((0, 10**6))
                assert cluster.serve(ExpirePoints(workload.time)).result == one.expire(workload.time, None)
            requests = [
                RootWrite(WriteBatch(None, workload.batch()), now=0.0) for _ in range(draw.choice((1, 1, 2, 5)))
            ]
            cluster.serve(*requests)
            for request in requests:
                met[compare(one, request, workload)] += 1
            check(one, cluster)
        check_reads(one, cluster, settings)
    assert met["applied"] > ROUNDS
    assert met["refused"] > ROUNDS / 10
    assert met["divided in another way"] > 3


def reshard(one, cluster, shards):
    """Divide it among this number of shards. Returns whether that was another one: then it is a revision."""
    before = len(cluster.shard_logs)
    request = cluster.serve(Reshard(shards))
    assert len(cluster.shard_logs) == shards
    if shards != before:
        one.counts.revision, one.counts.cause = one.counts.revision + 1, "batch"
    assert request.result == one.counts.revision
    check(one, cluster)
    return shards != before


def compare(one, request, workload):
    """Apply the batch to one hull, and compare. Returns what came of it."""
    refusal, before = None, one.vertices()
    try:
        applied = one.apply(request.batch.write, 0.0, None)
    except Exception as error:
        refusal = error
    if refusal is not None:
        assert request.error is not None, refusal
        if not isinstance(refusal, LimitExceededError):  # it may break other rules, too, any of which may be named
            assert (type(request.error), str(request.error)) == (type(refusal), str(refusal))
        return "refused"
    assert request.error is None, request.error
    assert same_effect(request.result, applied, before, one.vertices()), (request.result, applied)
    workload.applied(request.batch.write)
    return "duplicate" if applied.duplicate else "applied"


def check(one, cluster):
    root = cluster.root
    assert (root.revision, root.points, root.clock) == (one.counts.revision, one.counts.points, one.counts.clock)
    assert CAUSES[root.cause] == CAUSES[one.counts.cause]
    assert np.array_equal(root.hull.vertices(), one.vertices())
    if root.distinct is not None:
        assert root.distinct == one.counts.distinct
    else:
        assert root.vertex_keys() == one.vertex_keys().tolist()


def check_reads(one, cluster, settings):
    def read(question):
        revision, answer = cluster.serve(Read(question)).result
        assert revision == one.counts.revision
        return answer

    points = one.hull.points()
    places = np.array([(x, y) for x in range(-9, 10) for y in range(-9, 10)], float)
    assert np.array_equal(read(CountOf(places)), one.hull.count_many(places))
    assert np.array_equal(read(SampleOf(1000)), points)
    assert np.array_equal(read(SampleOf(5)), sample(points, 5) if len(points) > 5 else points)
    assert read(StaticHull())
    if settings.identity == "int":
        keys = np.arange(100, dtype=np.uint64)
        assert np.array_equal(read(PositionsOf(keys)), one.hull.positions(keys), equal_nan=True)


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        (HullSettings(frame="geographic"), "frame"),
        (HullSettings(window=Window(max_points=5)), "window.max_points"),
        (HullSettings("int", quarantine=QuarantineRules(max_growth=2.0)), "quarantine"),
    ],
)
def test_what_cannot_be_divided_is_refused(settings, field):
    with pytest.raises(ValueError, match=field):
        Cluster(settings, LIMITS, 2)


def test_a_batch_about_the_quarantine_is_refused():
    no_keys = np.empty(0, np.uint64)
    batch = KeyedBatch("int", no_keys, NO_POINTS, no_keys, drops=np.array([7], np.uint64))
    cluster = Cluster(HullSettings("int"), LIMITS, 2)
    request = cluster.serve(RootWrite(WriteBatch(None, Write("hull", batch, 0)), now=0.0))
    assert isinstance(request.error, HullUnsuitableError)
    assert "has shards, so it has no quarantine" in str(request.error)
    assert cluster.root.revision == 0


def test_points_without_keys_have_no_positions_of_keys():
    with pytest.raises(ValueError, match="positions of keys"):
        Cluster(HullSettings(), LIMITS, 2).serve(Read(PositionsOf(np.arange(3, dtype=np.uint64))))
