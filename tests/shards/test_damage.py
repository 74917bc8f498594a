"""A shard that has not what was decided is found when it opens."""

import pytest
from shards.memory_logs import Cluster
from shards.workload import KINDS, LIMITS, Workload

from dynhull_cluster.shards.messages import StaticHull
from dynhull_cluster.shards.requests import Read, RootWrite
from dynhull_cluster.shards.root import ShardsDifferError
from dynhull_server.state.requests import WriteBatch


@pytest.fixture
def cluster():
    settings = KINDS["points"]
    cluster, workload = Cluster(settings, LIMITS, 2), Workload(settings, seed=1)
    while min(len(log.steps) for log in cluster.shard_logs) < 5:
        write = workload.batch()
        if cluster.serve(RootWrite(WriteBatch(None, write), now=0.0)).error is None:
            workload.applied(write)
    return cluster


def test_a_root_finds_that_a_log_lost_its_end(cluster):
    del cluster.shard_logs[1].steps[-1]
    cluster.restart_shard(1)
    with pytest.raises(ShardsDifferError, match="its log has lost steps"):
        cluster.restart_root()


def test_a_root_that_goes_on_finds_it(cluster):
    del cluster.shard_logs[1].steps[-1]
    cluster.restart_shard(1)
    with pytest.raises(ShardsDifferError, match="its log has lost steps"):
        cluster.serve(Read(StaticHull()))


def test_points_that_changed_on_a_disk_are_found(cluster):
    for _, records in cluster.shard_logs[0].steps:
        for record in records:
            record.rows.inserts = record.rows.inserts * 2
            record.rows.lenient = True
    cluster.restart_shard(0)
    with pytest.raises(ShardsDifferError, match="other vertices"):
        cluster.serve(Read(StaticHull()))
