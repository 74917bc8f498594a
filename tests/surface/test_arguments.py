"""Errors of the server name what the caller of the SDK has written."""

import inspect
import pickle

import pytest

from dynhull_client import AsyncHullClient, HullClient, InvalidRequestError, PointMissingError
from dynhull_surface.names import NAMES, find

NO_ARGUMENTS = {"config", "rule", "batch", "batch.puts"}  # messages as a whole


@pytest.mark.parametrize("client", [HullClient, AsyncHullClient])
def test_every_field_is_called_as_an_argument_is(client):
    methods = {name: method for name, method in inspect.getmembers(client, callable) if not name.startswith("_")}
    known = {*methods, *(name for method in methods.values() for name in inspect.signature(method).parameters)}
    called = {path: find(path).argument.partition("[")[0].partition(".")[0] for path in NAMES}
    assert {path: name for path, name in called.items() if name not in known} == {
        each: each.partition(".")[0] for each in NO_ARGUMENTS
    }


@pytest.fixture
def client(address):
    with HullClient(address) as connected:
        yield connected


@pytest.mark.parametrize(
    ("call", "field", "message"),
    [
        (lambda client, hull: client.apply(hull, delete=[[8, 8]]), "batch.deletes", "delete row 0 is (8.0, 8.0): "),
        (
            lambda client, hull: client.apply(hull, move=([[1, 1], [9, 9]], [[2, 2], [3, 3]])),
            "batch.moves.origins",
            "move[0] row 1 is (9.0, 9.0): ",
        ),
        (
            lambda client, hull: client.create_fence(hull, area=[[0, 0], [1, 0], [2, 0]], subjects=f"{hull}-keyed"),
            "config.polygon_area.polygons[0].exterior",
            "area.polygons[0].exterior",
        ),
        (
            lambda client, hull: client.remove(f"{hull}-keyed", ["b", "b"]),
            "batch.removes",
            "remove row 1 is b: ",
        ),
    ],
    ids=["delete", "move", "area", "remove"],
)
def test_errors_name_arguments(client, name, call, field, message):
    client.create_hull(name)
    client.create_hull(f"{name}-keyed", keyed="str")
    client.apply(name, insert=[[1, 1]])
    with pytest.raises((InvalidRequestError, PointMissingError)) as refused:
        call(client, name)
    error = refused.value
    assert str(error).startswith(message)
    assert "removes" not in str(error)
    assert error.field == field
    assert error.problem in str(error).replace("remove row 0", "removes row 0")
    again = pickle.loads(pickle.dumps(error))
    assert (str(again), again.problem, again.row) == (str(error), error.problem, error.row)
