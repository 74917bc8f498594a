"""What roots and shards send each other, as bytes: it comes back as it was, and damage is noticed."""

import asyncio

import numpy as np
import pytest
from patience import PATIENCE

from dynhull.keys import PackedKeys
from dynhull_cluster.divisions.letters import Answer, Greeted, Greeting, IsWanted, Letter, Wanted
from dynhull_cluster.divisions.peers import PeerAwayError, Peers
from dynhull_cluster.divisions.wire import VERSION, WireError, pack, unpack
from dynhull_cluster.shards import messages as say
from dynhull_cluster.sockets import Sockets
from dynhull_server.state.batch import NO_POINTS, Applied, Batch
from dynhull_server.state.contents import gate, keyed, windowed
from dynhull_server.state.errors import KeyMissingError, PointMissingError
from dynhull_server.state.records import Contents, HullSettings, KeyRows, Window

POINTS = np.array([[1.5, -0.0], [np.nan, 2.0**-1074]])
STRINGS = PackedKeys.pack(["a", "ä" * 100])
NUMBERS = np.array([0, 2**64 - 1], np.uint64)
TIMES = np.array([-(2**63), 2**63 - 1])
TOTALS = say.ShardTotals(3, 2, None)
ROWS = KeyRows(STRINGS, POINTS, PackedKeys(b"", b""), TIMES, None, "absent")
CHANGE = say.VertexChange(say.Corners(NO_POINTS, ()), say.Corners(POINTS, ("a", 2**64 - 1)))
MESSAGES = [
    Greeting("fleet/a", "0a", 1.5, HullSettings("str", window=Window(7, clock="data"), shards=3, shard=2)),
    Greeted(2**40),
    Wanted("fleet", "0a", 7),
    IsWanted(wanted=True),
    Letter("0a", 7, 2, say.Open(1, 1, 9)),
    Letter("0a", 0, 0, say.Undo(1, 2, 9)),
    Letter("0a", 0, 0, say.Apply(1, 2, (say.Step(1, Batch(POINTS, NO_POINTS, 0, count_missing=True), None, True),))),
    say.Step(2, windowed.AdmittedRows(Batch(POINTS, NO_POINTS, 0, count_missing=False), TIMES, 5, 0, 0), 5, False),
    say.Step(3, gate.AdmittedPuts(ROWS, None, 1, 0, refuse_missing=True), None, False),
    say.Ask(1, 3, say.FoundOf(NUMBERS)),
    say.Ask(1, 3, say.CountOf(POINTS)),
    say.Ask(1, 3, say.SlotsOf(5, 1024)),
    Answer(None),
    Answer(say.Opened(1, 1, 0, TOTALS, say.Corners(POINTS, None))),
    Answer(say.Done(1, 2, (say.Effect(1, TOTALS, 1, CHANGE, Applied(1, 2, 0, 0, True, 3, held=[1]), None),))),
    Answer(say.Answered(1, 3, keyed.Found(POINTS, np.array([True, False]), TIMES, np.array([0.0, 2.5])))),
    Answer(say.Answered(1, 3, Contents(POINTS, STRINGS, TIMES, None))),
    Answer(say.Closed(1, 3)),
]


def plain(value: object) -> object:
    """A value as something that compares: arrays by their bytes, lists as tuples, objects by their attributes."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, list | tuple):
        return tuple(map(plain, value))
    names = getattr(type(value), "__dataclass_fields__", None)
    if names is None:
        return value
    return type(value), *(plain(getattr(value, name)) for name in names)


@pytest.mark.parametrize("message", MESSAGES, ids=range(len(MESSAGES)))
def test_a_message_comes_back_as_it_was(message: object) -> None:
    data = pack(message)
    assert data[0] == VERSION
    assert plain(unpack(data)) == plain(message)
    for end in range(0, len(data), max(1, len(data) // 50)):
        with pytest.raises(WireError):
            unpack(data[:end])
    with pytest.raises(WireError, match="goes on after its end"):
        unpack(data + b"\0")


@pytest.mark.parametrize("error", [KeyMissingError(3, "a"), PointMissingError("origins", 1, (0.5, -1.0))])
def test_a_refusal_comes_back_with_its_row(error: Exception) -> None:
    again = unpack(pack(error))
    assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


def test_a_message_of_another_version_is_refused() -> None:
    with pytest.raises(WireError, match=f"has version {VERSION + 1}, not {VERSION}"):
        unpack(bytes([VERSION + 1]) + pack(None)[1:])


def test_what_no_message_has_is_refused() -> None:
    with pytest.raises(TypeError, match="no message between shards has a dict"):
        pack({})


class Dying(Sockets):
    """A worker that ends just as it is reached."""

    async def connect(self, worker, make):
        frames = await super().connect(worker, make)
        frames.abort()
        while frames.connected:
            await asyncio.sleep(0)
        return frames


def test_a_worker_that_ends_as_it_is_reached_is_away(tmp_path):
    async def ask():
        sockets = Dying(tmp_path)
        async with await asyncio.start_unix_server(lambda _, writer: writer.close(), sockets.frames(1)):
            peers = Peers(sockets)
            for _ in range(3):
                with pytest.raises(PeerAwayError, match="worker 1"):
                    await asyncio.wait_for(peers.ask(1, b"letter"), PATIENCE)
            peers.close()

    asyncio.run(ask())
