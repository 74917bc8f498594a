"""The past of hulls that keep theirs, as clients of real processes see it: how much is there, and that it survives."""

import json
import os
from concurrent.futures import ThreadPoolExecutor
from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from cases import slow, with_all_cases
from command_line import dynhull
from metrics import measured, scrape
from patience import PATIENCE, wait_until
from server_process import run, server_process, shape_options
from wall_clock import at

from dynhull_client import (
    DynhullError,
    HullClient,
    HullUnsuitableError,
    InvalidRequestError,
    PastDamagedError,
    UnavailableError,
)
from dynhull_server.state.records import KeyRows
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.sqlite.storage import SQLiteStorage

KEYS = [f"vehicle {i}" for i in range(40)]
BATCHES = 12  # between two looks
KILLS = 40
HOLE = "a part of the past cannot be read"  # what the server says of it
SNAPSHOTS = ("--snapshot-points", "200")


def positions(revision):
    return np.round(np.random.default_rng(revision).random((len(KEYS), 2)), 7)


def write_until_filed(client, name, batches):
    """Write until segments have so many batches; returns the last revision."""
    revision = client.get_hull(name).info.revision

    def filed():
        nonlocal revision
        for _ in range(BATCHES):
            revision += 1
            assert client.put(name, KEYS, positions(revision)).revision == revision
        return client.history(name).batches >= batches

    wait_until(filed)
    return revision


@slow
def test_the_past_is_dropped_by_the_time_of_its_commits_after_the_clock_was_set_back(tmp_path):
    with (
        server_process("--data", str(tmp_path), *SNAPSHOTS, wrap=at("+1h")) as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", keyed="str", history=1)
        ahead = write_until_filed(client, "fleet", 1)
    with server_process("--data", str(tmp_path), *SNAPSHOTS) as server, HullClient(server.address) as client:

        def dropped():
            write_until_filed(client, "fleet", 0)
            return client.history("fleet").first_revision > ahead

        wait_until(dropped)


@slow
def test_readers_at_once_share_a_past_and_a_segment_that_is_gone_is_named(tmp_path):
    options = "--data", str(tmp_path), *SNAPSHOTS
    with measured(*options, complaints=HOLE) as (server, metrics), HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str", history="30d")
        write_until_filed(client, "fleet", 1)
        with ThreadPoolExecutor(8) as threads:
            pasts = list(threads.map(lambda _: client.at("fleet", 2).positions(KEYS).positions.tolist(), range(8)))
        assert all(each == positions(2).tolist() for each in pasts)
        found = scrape(metrics)
        assert found['dynhull_past_reads_total{outcome="anew"}'] == 1
        assert found['dynhull_past_reads_total{outcome="kept"}'] >= 15
        assert not [name for name in found if name.startswith("dynhull_past_holes")]

        write_until_filed(client, "fleet", client.history("fleet").batches + 1)
        newest = max(tmp_path.rglob("*.batches.parquet"))  # nobody has read it
        first, last, *_ = newest.name.split("-")
        content = newest.read_bytes()
        newest.unlink()
        with pytest.raises(DynhullError, match=f"revisions {int(first)} to {int(last)} cannot be read") as refused:
            client.at("fleet", int(first))
        assert newest.name.removesuffix(".batches.parquet") in str(refused.value)
        assert str(tmp_path) not in str(refused.value)  # where the server's files are is the operator's
        found = scrape(metrics)
        assert found[f'dynhull_past_holes{{first="{int(first)}",hull="fleet",last="{int(last)}"}}'] == 1
        assert found['dynhull_past_reads_total{outcome="unreadable"}'] >= 1
        client.remove("fleet", KEYS[:1])
        with pytest.raises(PastDamagedError, match=f"revisions {int(first)} to {int(last)} cannot be read") as refused:
            client.erase_history("fleet", KEYS[:1])
        assert str(tmp_path) not in str(refused.value)
        newest.write_bytes(content)
        assert client.at("fleet", int(first)).positions(KEYS).positions.tolist() == positions(int(first)).tolist()
        assert not [name for name in scrape(metrics) if name.startswith("dynhull_past_holes")]


def test_what_was_written_faster_than_snapshots_come_is_in_segments_without_more_batches(tmp_path):
    """The journal has no more than what makes two snapshots due, and what was written since."""
    batches = 500
    with server_process("--data", str(tmp_path), *SNAPSHOTS) as server, HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str", history="30d")
        with client.writer("fleet") as writer:
            for revision in range(1, batches + 1):
                writer.put(keys=KEYS, points=positions(revision))
        assert client.get_hull("fleet").info.revision == batches
        wait_until(lambda: batches * len(KEYS) - client.history("fleet").moves < 3 * 200)
        _, points = client.track("fleet", KEYS[:1])[KEYS[0]]
        assert points.tolist() == [positions(revision)[0].tolist() for revision in range(1, batches + 1)]


@slow
def test_what_is_in_memory_or_a_part_of_a_file_does_not_hide_a_hole(tmp_path):
    with (
        measured("--data", str(tmp_path), *SNAPSHOTS, complaints=HOLE) as (server, metrics),
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", keyed="str", history="30d")
        write_until_filed(client, "fleet", 1)
        client.at("fleet", 2).positions(KEYS)  # the batches stay in memory
        file = min(tmp_path.rglob("*.batches.parquet"))
        first, last, *_ = file.name.split("-")
        content = file.read_bytes()
        file.write_bytes(content + b"more")
        named = f"revisions {int(first)} to {int(last)} cannot be read"
        with pytest.raises(PastDamagedError, match=named):
            client.track("fleet", KEYS[:1])
        client.at("fleet", 3).positions(KEYS)
        hole = f'dynhull_past_holes{{first="{int(first)}",hull="fleet",last="{int(last)}"}}'
        assert scrape(metrics)[hole] == 1

        file.write_bytes(content)
        client.track("fleet", KEYS[:1])
        assert hole in scrape(metrics), "a part of a file says nothing of the rest"
    with (
        measured("--data", str(tmp_path), *SNAPSHOTS, complaints=HOLE) as (server, metrics),
        HullClient(server.address) as client,
    ):
        file.unlink()
        os.mkfifo(file)  # nobody writes to it
        with pytest.raises(UnavailableError, match=named):
            client.at("fleet", int(first))
        assert scrape(metrics)[hole] == 1
        file.unlink()
        file.write_bytes(content)
        client.at("fleet", int(first)).positions(KEYS)
        assert hole not in scrape(metrics)


def test_a_feed_ends_at_a_hole_with_its_revisions_and_goes_on_behind_it(tmp_path):
    with (
        server_process("--data", str(tmp_path), *SNAPSHOTS, complaints=HOLE) as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", keyed="str", history="30d")
        revision = write_until_filed(client, "fleet", 1)
        file = min(tmp_path.rglob("*.batches.parquet"))
        file.unlink()
        last = int(file.name.split("-")[1])
        named = f"revisions 1 to {last} cannot be read"
        for begin in ({"after": 0}, {"consumer": "sink"}):
            with client.feed("fleet", **begin, timeout=PATIENCE) as feed, pytest.raises(PastDamagedError, match=named):
                next(feed)
        with client.feed(prefix="", after=0, timeout=PATIENCE) as feed, pytest.raises(PastDamagedError, match=named):
            next(feed)
        command = run("feed", "fleet", "--after", "0", "--address", server.address)
        assert (command.returncode, named in command.stderr) == (1, True), command.stderr
        client.ack_feed("fleet", consumer="sink", after=last)
        with client.feed("fleet", consumer="sink", timeout=PATIENCE) as feed:
            assert [next(feed).revision for _ in range(revision - last)] == list(range(last + 1, revision + 1))


@slow
def test_a_feed_of_a_prefix_gives_what_is_before_a_hole_and_goes_on_behind_it(tmp_path):
    with (
        server_process("--data", str(tmp_path), *SNAPSHOTS, complaints=HOLE) as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", keyed="str", history="30d")
        write_until_filed(client, "fleet", 1)
        revision = write_until_filed(client, "fleet", client.history("fleet").batches + 1)
        file = sorted(tmp_path.rglob("*.batches.parquet"))[1]
        first = int(file.name.split("-")[0])
        content = file.read_bytes()
        file.unlink()
        found, position = [], 0
        with client.feed(prefix="", after=0, timeout=PATIENCE) as feed:
            for _ in range(1, first):
                batch = next(feed)
                found.append(batch.revision)
                position = batch.after or position
            with pytest.raises(PastDamagedError, match=f"{first} to"):
                next(feed)
        assert found == list(range(1, first))
        file.write_bytes(content)
        with client.feed(prefix="", after=position, timeout=PATIENCE) as feed:
            rest = [each.revision for each in (next(feed) for _ in range(revision - first + 3)) if each.type == "batch"]
        assert rest[:2] == [first - 1, first], "the commit before the hole might have had more"


def test_how_much_is_kept_is_told_changed_and_lost_with_the_hull(tmp_path):
    with server_process("--data", str(tmp_path), *SNAPSHOTS) as server, HullClient(server.address) as client:
        begun = datetime.now(UTC)
        client.create_hull("fleet", keyed="str", history="30d")
        assert client.history("fleet").history == timedelta(days=30)
        revision = write_until_filed(client, "fleet", 1)
        found = client.history("fleet")
        assert (found.first_revision, found.last_revision) == (0, revision)
        assert begun - timedelta(seconds=1) < found.first_time < found.last_time < datetime.now(UTC)
        assert found.moves == found.batches * len(KEYS)
        kept = {each.name: each.stat().st_size for each in tmp_path.rglob("*.parquet")}
        assert sum(kept.values()) >= found.bytes > 0
        said = dynhull("history", "fleet", "--address", server.address).output
        assert said.startswith("fleet: from revision 0 of 20")
        assert said.endswith("of segments, kept for 30d\n")

        client.set_history("fleet", True, found.bytes // 2)
        assert (client.history("fleet").history, client.history("fleet").history_bytes) == (True, found.bytes // 2)
        wait_until(lambda: client.history("fleet").bytes <= found.bytes // 2)
        assert client.history("fleet").first_revision > 0
        place = "--address", server.address
        for options in ("--history", "30d"), ("--history", "forever", "--history-bytes", "1000"):
            assert dynhull("create", options[1], *options, *place).exit_code == 0
            shown = json.loads(dynhull("history", options[1], "--json", *place).stdout)
            assert (shown["history"], shown["history_bytes"]) in ((30 * 86400, None), (True, 1000))
        for refused in (
            ("create", "x", "--history-bytes", "9"),
            ("history", "set", "fleet", "none", "--history-bytes", "9"),
        ):
            assert "--history-bytes is given with" in dynhull(*refused, *place).stderr
        assert dynhull("history", "set", "fleet", "none", *place).exit_code == 0
        wait_until(lambda: client.history("fleet").bytes == 0)
        assert client.history("fleet").history is None
        wait_until(lambda: not list(tmp_path.rglob("*.parquet")))


@with_all_cases
def test_the_past_is_whole_after_kills(tmp_path):
    """Every acknowledged batch is in a segment or in the journal, in its place, whatever is being written."""
    revision = 0
    for life in range(KILLS + 1):
        with server_process("--data", str(tmp_path), *SNAPSHOTS, killed=life < KILLS) as server:
            with HullClient(server.address) as client:
                if not life:
                    client.create_hull("fleet", keyed="str", history=True)
                assert client.history("fleet").first_revision == 0
                before = client.history("fleet").batches
                revision = write_until_filed(client, "fleet", before + 1 + life % 3 * BATCHES)
            if life < KILLS:
                server.process.kill()
                server.process.wait(PATIENCE)
    data = tmp_path if not shape_options() else next(tmp_path.rglob("history")).parent
    storage = SQLiteStorage(data, archive=Archive(data / "history"))
    notes = storage.open(lambda *_: None).notes
    (number,) = [hull.row.number for hull in storage._ledger.hulls.values() if hull.row.name == "fleet"]
    found = []
    while len(found) < revision:
        found += storage.batches(number, len(found), revision)
    storage.close()
    assert notes == []
    assert [each.revision for each in found] == list(range(1, revision + 1))
    times = [each.committed for each in found]
    assert times == sorted(times)
    for each in found:
        assert isinstance(each.rows, KeyRows)
        assert list(each.rows.keys) == KEYS
        np.testing.assert_array_equal(each.rows.points, positions(each.revision))


def test_what_cannot_be_is_refused(client, name, tmp_path):
    for history, problem in (
        ("30 years", "text such as 500ms"),
        (0, "more than 0"),
        (-5, "more than 0"),
        ([], "history is \\[\\]: must be a finite number of seconds"),
    ):
        with pytest.raises((ValueError, TypeError), match=problem):
            client.create_hull(name, history=history)
    for size in (0, 1.5, True, 2**63):
        with pytest.raises((ValueError, TypeError), match="history_bytes"):
            client.create_hull(name, history=True, history_bytes=size)
    with pytest.raises(ValueError, match="history_bytes is given with history"):
        client.create_hull(name, history_bytes=5)
    with pytest.raises(InvalidRequestError, match="at most"):
        client.create_hull(name, history=timedelta.max)
    with server_process("--in-memory") as server, HullClient(server.address) as other:
        with pytest.raises(HullUnsuitableError, match="in memory, which keeps no history"):
            other.create_hull("fleet", history=True)
        other.create_hull("fleet")
        with pytest.raises(HullUnsuitableError, match="in memory"):
            other.set_history("fleet", "1h")
        other.set_history("fleet", None)
        assert other.history("fleet").bytes == 0
    refused = dynhull("serve", "--in-memory", "--history-dir", str(tmp_path))
    assert refused.exit_code
    assert "--history-dir keeps what --in-memory does not store" in refused.stderr
