"""What fences cost: writes without any, not one instruction of Python more; keys that expire, each the same."""

import sys
from types import FrameType
from typing import Any

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull import FenceIndex
from dynhull.keys import PackedKeys
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.contents import keyed as keyed_contents
from dynhull_server.state.core import Core
from dynhull_server.state.events import Commit, Committed, Compute, Computed, Event, Tick
from dynhull_server.state.fences.index.subjects import keyed
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.fences.model.requests import CreateFence, DeleteFence
from dynhull_server.state.records import HullSettings
from dynhull_server.state.requests import Birth, CreateHull, WriteBatch

KEYS = PackedKeys.pack(f"k{row:02}" for row in range(64))
FAR, NEAR = (np.random.default_rng(seed).random((64, 2)) + 10 * seed for seed in (1, 0))


def asked(core: Core, request: Any) -> None:
    """Carry out a request; every commit succeeds at once."""
    carry_out(core, request)
    assert request.error is None


def carry_out(core: Core, event: Event) -> None:
    for effect in core.step(event):
        if isinstance(effect, Compute):
            effect.ticket.run()
            carry_out(core, Computed(effect.ticket))
        if isinstance(effect, Commit) and effect.ticket is not None:
            carry_out(core, Committed(effect.ticket))


def write(points: np.ndarray) -> WriteBatch:
    return WriteBatch(None, Write("fleet", KeyedBatch("str", KEYS, points, PackedKeys.pack([])), 0, 64))


def instructions(core: Core) -> int:
    """The bytecodes of two messages of 64 points that move all keys there and back, and the calls out of Python."""
    count = 0

    def trace(frame: FrameType, event: str, _: object) -> Any:
        nonlocal count
        frame.f_trace_opcodes = True
        count += event == "opcode"
        return trace

    def profile(_: FrameType, event: str, __: object) -> None:
        nonlocal count
        count += event == "c_call"

    for _ in range(2):  # the first time, more is new than the fences
        count = 0
        for points in (FAR, NEAR):
            before = sys.gettrace(), sys.getprofile()
            sys.settrace(trace)
            sys.setprofile(profile)
            try:
                asked(core, write(points))
            finally:
                sys.setprofile(before[1])
                sys.settrace(before[0])
    return count


@pytest.mark.parametrize("immediate", [True, False])
def test_a_hull_without_fences_does_not_pay_for_those_of_others(*, immediate: bool) -> None:
    core = Core(LIMITS, immediate=immediate)
    for name in ("fleet", "others"):
        asked(core, CreateHull(None, name, Birth(name, 1.0), HullSettings("str")))

    def fence(name: str, subjects: str) -> None:
        config = FenceConfig(CircleArea(0.5, 0.5, 2.0), "hull", subjects)
        asked(core, CreateFence(None, name, 1, config, Birth(name, 1.0)))

    never = instructions(core)
    assert never > 500
    fence("elsewhere", "others")
    assert instructions(core) == never
    fence("here", "fleet")
    assert instructions(core) > never
    asked(core, DeleteFence(None, "here", 2))
    assert instructions(core) == never
    assert not core.busy
    FenceIndex(keyed(core.get("fleet").state)).detach()  # refused while the kernel keeps a journal for another one


class Counted(int):
    """A key that counts how often it is compared."""

    compared = 0

    def __eq__(self, other: object) -> bool:
        Counted.compared += 1
        return int(self) == other

    __hash__ = int.__hash__


def test_keys_that_expire_in_a_fence_are_not_compared_with_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    core, keys = Core(LIMITS), np.arange(1000, dtype=np.uint64)
    asked(core, CreateHull(None, "fleet", Birth("fleet", 1.0), HullSettings("int")))
    config = FenceConfig(CircleArea(0.5, 0.5, 2.0), "hull", "fleet")
    asked(core, CreateFence(None, "here", 1, config, Birth("here", 1.0)))
    ends = np.full(len(keys), 10**6)
    points = np.random.default_rng(0).random((len(keys), 2))
    put = WriteBatch(None, Write("fleet", KeyedBatch("int", keys, points, keys[:0], deadlines=ends), 0, 64))
    monkeypatch.setattr(keyed_contents, "key_list", lambda some: [Counted(key) for key in some.tolist()])
    asked(core, put)
    Counted.compared = 0
    carry_out(core, Tick(1.0, 2 * 10**6))
    assert len(core.get("fleet").state.hull) == 0
    assert Counted.compared <= 2 * len(keys)
    assert core.fence("here").last == 1 + 2 * len(keys)
