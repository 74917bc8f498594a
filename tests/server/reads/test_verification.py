"""A verification names the first difference of a wrong hull."""

import asyncio
from collections.abc import Callable

import numpy as np
import pytest

from dynhull_proto.v1 import points_pb2
from dynhull_server.engine.verification import verify
from dynhull_server.rpc.encode import encode_verification
from dynhull_server.state.hull_state import Counts


async def at_once(function: Callable[[], object]) -> object:
    return function()


POINTS = np.array([[0.0, 0], [4, 0], [4, 4], [0, 4], [1, 1]])
VERTICES = POINTS[:4]


@pytest.mark.parametrize(
    ("live", "row", "there", "expected"),
    [
        (VERTICES[:3], 3, [], [0, 4]),
        (VERTICES[1:], 0, [4, 0], [0, 0]),
        (np.array([[0.0, 0], [4, 0], [4, 4], [1, 1]]), 3, [1, 1], [0, 4]),
        (POINTS, 4, [1, 1], []),
    ],
    ids=["a vertex less", "the wrong start", "another vertex", "a vertex more"],
)
def test_the_first_difference_is_told(live: np.ndarray, row: int, there: list[float], expected: list[float]) -> None:
    message = encode_verification(
        Counts(7, 5, 5), asyncio.run(verify(POINTS, live, at_once)), points_pb2.POINT_ENCODING_COORDINATES
    )
    assert not message.equal
    assert (message.revision, message.point_count, message.vertex_count) == (7, 5, len(live))
    assert message.first_difference.index == row
    assert list(message.first_difference.live.coordinates) == there
    assert list(message.first_difference.recomputed.coordinates) == expected


def test_a_right_hull_is_equal() -> None:
    assert asyncio.run(verify(POINTS, VERTICES, at_once)).difference is None
