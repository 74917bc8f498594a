"""Errors as values: they go through process pools, queues and Ray, and can be copied."""

import copy
import pickle
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any

import grpc
import pytest

import dynhull_client
from dynhull_client import DynhullError, HullClient, HullNotFoundError, UnavailableError

METADATA = {"field": "points", "row": "3", "value": "nan", "first_row": "1", "oldest": "7", "last": "9", "fence": "a"}
KINDS = [each for each in vars(dynhull_client).values() if isinstance(each, type) and issubclass(each, DynhullError)]
WAYS: list[Callable[[Any], Any]] = [
    *(lambda error, protocol=protocol: pickle.loads(pickle.dumps(error, protocol)) for protocol in range(6)),
    copy.copy,
    copy.deepcopy,
]


def facts(error: DynhullError) -> dict[str, Any]:
    properties = {name for each in type(error).__mro__ for name, value in vars(each).items() if type(value) is property}
    return {
        **vars(error),
        **{name: getattr(error, name) for name in properties},
        "metadata": dict(error.metadata),
        "type": type(error),
        "args": error.args,
        "text": str(error),
    }


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("kind", KINDS)
def test_an_error_survives(kind: type[DynhullError], way: Callable[[Any], Any]) -> None:
    error = kind("row 3 of points", grpc.StatusCode.INVALID_ARGUMENT, "INVALID_FIELD", METADATA)
    error.add_note("of the second file")
    error.batch = 5
    again = way(error)
    assert facts(again) == facts(error)
    assert again.row == 3
    with pytest.raises(TypeError):
        again.metadata["row"] = "4"


def fail_to_read(address: str) -> None:
    with HullClient(address, retries=0, timeout=20) as client:
        client.get_hull("missing")


def test_a_process_pool_hands_them_on(address: str) -> None:
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        refused = pool.submit(fail_to_read, address)
        unreachable = pool.submit(fail_to_read, "127.0.0.1:1")
        with pytest.raises(HullNotFoundError, match="missing") as found:
            refused.result()
        assert found.value.reason == "HULL_NOT_FOUND"
        with pytest.raises(UnavailableError) as lost:
            unreachable.result()
        assert lost.value.code is grpc.StatusCode.UNAVAILABLE
