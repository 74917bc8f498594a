"""Polygons are checked beside other requests, not in a turn in which changes of structure wait for each other."""

import asyncio
import threading
from typing import Any

import numpy as np
import pytest
from live_engine import engine_in_memory
from patience import turns

from dynhull import _rings
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.fences import MOST_CHECKS
from dynhull_server.state.errors import InvalidFenceError
from dynhull_server.state.fences.model.config import FenceConfig, PolygonArea
from dynhull_server.state.records import HullSettings

SQUARE, HOLE, BESIDE = [[0, 0], [6, 0], [6, 6], [0, 6]], [[2, 2], [4, 2], [4, 4]], [[8, 8], [9, 8], [9, 9]]


def area(*rings: list[list[int]]) -> PolygonArea:
    return PolygonArea((tuple(np.array(ring, "<f8").tobytes() for ring in rings),))


@pytest.mark.parametrize("kind", ["plane", "globe", "prefix", "nobody"])
def test_turns_check_no_polygons(monkeypatch: pytest.MonkeyPatch, kind: str) -> None:
    threads: list[str] = []
    check = _rings._as_polygon

    def noted(*arguments: Any) -> Any:
        threads.append(threading.current_thread().name)
        return check(*arguments)

    monkeypatch.setattr(_rings, "_as_polygon", noted)
    subjects = {"plane": "fleet", "globe": "ships", "prefix": "fleet", "nobody": "none/"}[kind]
    config = FenceConfig(area(SQUARE, HOLE), "prefix" if kind in ("prefix", "nobody") else "hull", subjects)
    wrong = FenceConfig(area(SQUARE, BESIDE), config.kind, subjects)

    async def life(engine: Engine) -> None:
        await engine.hulls.create("fleet", HullSettings("str"))
        await engine.hulls.create("ships", HullSettings("str", frame="geographic", center=(3.0, 3.0)))
        await engine.fences.create("fence", config)
        for change in (engine.fences.create("wrong", wrong), engine.fences.replace("fence", wrong)):
            with pytest.raises(
                InvalidFenceError, match=r"polygons\[0\]\.holes\[0\] is 3 corners: is a hole that is not"
            ):
                await change
        await engine.fences.replace("fence", FenceConfig(area(SQUARE), config.kind, subjects))

    async def run() -> None:
        async with engine_in_memory() as engine:
            await life(engine)

    asyncio.run(run())
    assert len(threads) == (6 if kind == "nobody" else 4)  # what is invalid in the plane may be valid on the globe
    assert all(thread.startswith("read") for thread in threads)


def test_checks_whose_callers_have_left_leave_threads_to_others(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[str] = []
    go_on = threading.Event()

    def slow(*_: Any) -> Any:
        begun.append(threading.current_thread().name)
        go_on.wait()
        raise ValueError("no polygon")

    monkeypatch.setattr(_rings, "_as_polygon", slow)

    async def run() -> None:
        async with engine_in_memory() as engine:
            await engine.hulls.create("fleet", HullSettings("str"))
            config = FenceConfig(area(SQUARE), "hull", "fleet")
            for number in range(5):
                caller = asyncio.create_task(engine.fences.create(f"fence-{number}", config))
                while len(begun) < min(number + 1, MOST_CHECKS):
                    await asyncio.sleep(0)
                await turns()
                caller.cancel()
                await asyncio.wait([caller])
            assert await engine.driver.aside(lambda: "read") == "read"
            go_on.set()
            with pytest.raises(InvalidFenceError):
                await engine.fences.create("fence", config)

    asyncio.run(run())
    assert len(begun) == MOST_CHECKS + 1
