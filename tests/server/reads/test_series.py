"""The measures that a server keeps: a row for every ten seconds in which a hull changed, for an hour."""

import asyncio
import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from command_line import dynhull
from metrics import measured, scrape
from patience import wait_until
from set_time import SetTime

from dynhull_client import AsyncHullClient, HullClient, HullNotFoundError, InvalidRequestError, Series

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]


def sampled(client: HullClient, name: str, time: SetTime) -> Series:
    """The series of a hull, once what it is now is kept: it has changed."""
    revision = client.get_hull(name).info.revision
    time.passes(11)
    found = []

    def has_row() -> bool:
        found[:] = [client.series(name)]
        return bool((found[0].revisions[:-1] == revision).any())

    wait_until(has_row)
    return found[0]


def test_a_row_for_each_ten_seconds_in_which_a_hull_changed(tmp_path: Path) -> None:
    time = SetTime(tmp_path)
    with measured("--scrub-cpu", "0", wrap=time.wrap) as (server, address), HullClient(server.address) as client:
        client.create_hull("a")
        client.create_hull("other")
        client.create_hull("globe", geographic=True)
        client.apply("a", insert=SQUARE)
        client.apply("globe", insert=[[0, 0], [1, 0], [0, 1]])
        sampled(client, "a", time)
        for shift in range(3):
            client.apply("a", insert=[[8, shift]])
        found = sampled(client, "a", time)
        assert found.revisions.tolist() == [1, 4, 4]
        assert found.points.tolist() == [4, 7, 7]
        assert found.vertices.tolist() == [4, 5, 5]
        assert found.areas.tolist() == [16, 28, 28]
        measures = client.get_measures("a")
        assert (found.perimeters[-1], found.diameters[-1]) == (measures.perimeter, measures.diameter)
        assert found.widths.tolist() == [4, 4, 4]
        assert found.rates[1:].tolist() == [0.3, 0]
        assert (found.uid, found.geographic, found.interval) == (client.get_hull("a").info.uid, False, 10)
        assert (found.changed_times <= found.times).all()
        assert found.since <= client.get_hull("a").info.created + timedelta(seconds=1)
        globe = client.series("globe")
        assert globe.geographic
        assert globe.areas[0] == client.get_hull("globe").measures.area
        assert np.isnan(globe.widths).all()

        client.apply("other", insert=SQUARE)
        sampled(client, "other", time)
        assert client.series("a").revisions.tolist() == [1, 4, 4]  # nothing has changed
        some = client.series("a", last=timedelta(seconds=5))
        assert (some.revisions.tolist(), some.since > found.since) == ([4, 4], True)
        assert asyncio.run(series_of(server.address, "a")) == client.series("a").areas.tolist()
        with pytest.raises(InvalidRequestError, match="last"):
            client.series("a", last=0)
        command = ("measure", "a", "--last", "1h", "--address", server.address)
        heading, *lines = dynhull(*command).stdout.splitlines()
        assert [line.split("\t")[4] for line in lines] == ["16.0", "28.0", "28.0"]
        assert heading.split("\t")[4] == "area"
        assert json.loads(dynhull(*command, "--json").stdout.splitlines()[1])["rate"] == 0.3
        assert scrape(address)["dynhull_series_hulls"] == 3

        client.apply("a", delete=[[8, 0]])
        sampled(client, "a", time)
        time.passes(3575)  # of what is older than an hour, the last row stays: the hull was so until the next one
        client.apply("other", insert=[[9, 9]])
        sampled(client, "other", time)
        wait_until(lambda: client.series("a").revisions.tolist() == [4, 5, 5])
        assert client.series("a").times[0] < np.datetime64(client.series("a").since.replace(tzinfo=None))
        client.delete_hull("a")
        with pytest.raises(HullNotFoundError):
            client.series("a")
        client.create_hull("a")
        assert client.series("a").revisions.tolist() == [0]
        assert scrape(address)["dynhull_series_hulls"] == 2


async def series_of(address: str, name: str) -> list[float]:
    async with AsyncHullClient(address) as client:
        return (await client.series(name)).areas.tolist()


@pytest.mark.one_process("each process has a limit of its own")
def test_the_oldest_rows_go_when_the_memory_for_them_is_full(tmp_path: Path) -> None:
    time = SetTime(tmp_path)
    said = "measures are kept for less time than --series-kept says: they take --series-bytes"
    options = ("--series-bytes", "1100", "--scrub-cpu", "0")
    with measured(*options, wrap=time.wrap, complaints=said) as (server, address), HullClient(server.address) as client:
        for name in ("a", "b"):
            client.create_hull(name)
        client.apply("a", insert=SQUARE)
        begun = sampled(client, "a", time).since
        for shift in range(3):
            client.apply("b", insert=[[shift, 0]])
            series = sampled(client, "b", time)
        assert series.revisions.tolist() == [2, 3, 3]  # and the first has gone
        assert series.since > begun
        assert client.series("a").areas.tolist() == [16, 16]
        samples = scrape(address)
        assert samples["dynhull_series_bytes"] <= 1100
        assert samples["dynhull_series_lost_samples_total"] >= 1
        assert samples["dynhull_series_reach_seconds"] < 60


def test_a_server_may_keep_none() -> None:
    with measured("--series-kept", "0") as (server, address), HullClient(server.address) as client:
        client.create_hull("a")
        client.apply("a", insert=SQUARE)
        before = datetime.now(UTC) - timedelta(seconds=1)
        found = client.series("a")
        assert (found.areas.tolist(), found.interval) == ([16], 0)
        assert found.since > before
        assert "dynhull_series_bytes" not in scrape(address)
