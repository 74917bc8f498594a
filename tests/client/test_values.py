"""The client as a person sees it in an interpreter: names, signatures, answers as values."""

import inspect
import pydoc
from collections.abc import Iterator
from importlib.metadata import version
from xml.etree import ElementTree

import geopandas
import numpy as np
import pandas as pd
import pytest
from shapely.geometry import shape

import dynhull
import dynhull_client
from dynhull_client import AsyncHullClient, HullClient, HullCopy, Located, Measures, Snapshot, Tangents

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4], [1, 1]]
EXPORTED = [
    "Alarm",
    "AlarmEvent",
    "AlarmExistsError",
    "AlarmNotFoundError",
    "AlarmNotRaisedError",
    "AlarmReplacedError",
    "AlarmStatus",
    "AlarmWatch",
    "Applied",
    "AsyncFeed",
    "AsyncFenceEvents",
    "AsyncAlarmWatch",
    "AsyncFenceWatch",
    "AsyncHullClient",
    "AsyncPast",
    "AsyncIngest",
    "AsyncManyWatch",
    "AsyncPipeline",
    "AsyncReplay",
    "AsyncWatch",
    "AsyncWriter",
    "Batch",
    "ChanRound",
    "Change",
    "Circle",
    "ConsumerNotFoundError",
    "Counted",
    "Crossings",
    "DeadlineError",
    "Deleted",
    "Difference",
    "Distances",
    "DuplicateKeyError",
    "DynhullError",
    "Efficient",
    "Entities",
    "Erasure",
    "Event",
    "Feed",
    "FeedBatch",
    "FeedConsumer",
    "FeedHeld",
    "Fence",
    "FenceConsumer",
    "FenceDifference",
    "FenceEvent",
    "FenceExistsError",
    "FenceNotFoundError",
    "FenceReplacedError",
    "FenceEvents",
    "FenceWatch",
    "HeldPosition",
    "History",
    "Hull",
    "HullClient",
    "HullCopies",
    "HullCopy",
    "HullEmptyError",
    "HullExistsError",
    "HullFencedError",
    "HullInfo",
    "HullNotFoundError",
    "HullReplacedError",
    "HullUnsuitableError",
    "Influence",
    "Ingest",
    "Ingested",
    "Inside",
    "InvalidRequestError",
    "KeyMissingError",
    "Layers",
    "LimitExceededError",
    "Located",
    "ManyChange",
    "ManyWatch",
    "Measured",
    "Measures",
    "MethodUnknownError",
    "OutcomeUnknownError",
    "PermissionDeniedError",
    "Phases",
    "Pipeline",
    "PointMissingError",
    "Points",
    "Polygon",
    "Past",
    "PastDamagedError",
    "Positions",
    "Prefix",
    "ProducerInUseError",
    "Progress",
    "Quarantine",
    "Replay",
    "RestoredError",
    "RevisionForgottenError",
    "Sampled",
    "Separation",
    "Series",
    "SequenceAheadError",
    "SequenceGapError",
    "Sketch",
    "Snapshot",
    "StaleCopyError",
    "Stored",
    "SubjectsInside",
    "Supported",
    "Tangents",
    "Track",
    "UnauthenticatedError",
    "UnavailableError",
    "Verification",
    "Watch",
    "Window",
    "Writer",
]
METHODS = [name for name in dir(HullClient) if not name.startswith("_") and callable(getattr(HullClient, name))]


@pytest.fixture
def client(address: str, connect: type[HullClient], name: str) -> Iterator[HullClient]:
    with connect(address) as client:
        client.create_hull(name)
        client.apply(name, insert=SQUARE)
        yield client


def test_completion_offers_what_is_documented() -> None:
    with_it = {"wkt"}  # the module that the command line shares
    assert {name for name in dir(dynhull_client) if not name.startswith("_")} == {*EXPORTED, *with_it}
    assert set(dynhull_client.__all__) == {*EXPORTED, "__version__"}
    classes = [value for value in vars(dynhull_client).values() if isinstance(value, type)]
    assert {kind.__module__ for kind in classes} == {"dynhull_client"}
    assert {name for name in dir(HullClient("127.0.0.1:1")) if not name.startswith("_")} == {*METHODS, "address"}
    # gRPC's channels for threads fail when they are closed while one follows their state.
    only_async = {"address", "presence"}
    assert set(METHODS) == {name for name in dir(AsyncHullClient) if not name.startswith("_")} - only_async
    assert all(inspect.getdoc(getattr(HullClient, name)) for name in METHODS)
    assert dynhull_client.__version__ == dynhull.__version__ == version("dynhull")


@pytest.mark.parametrize("kind", [HullClient, AsyncHullClient])
def test_signatures_can_be_read(kind: type) -> None:
    for name in METHODS:
        method = getattr(kind, name)
        signature = str(inspect.signature(method))
        assert len(signature) < 700, signature
        assert "_SupportsArray" not in signature
        assert "'npt" not in signature
        shown = pydoc.render_doc(method, renderer=pydoc.plaintext).split("\n")[2]
        assert shown.removeprefix("async ").startswith(f"{name}(self")


def test_a_signature_says_what_apply_takes() -> None:
    signature = inspect.signature(HullClient.apply)
    assert list(signature.parameters)[:5] == ["self", "name", "insert", "delete", "move"]
    assert str(signature).startswith("(self, /, name: str, *, insert: ArrayLike | None = None, ")
    assert str(signature).endswith(" -> Applied")


def test_answers_are_values(client: HullClient, name: str) -> None:
    for ask in (
        lambda: client.get_hull(name),
        lambda: client.locate(name, SQUARE),
        lambda: client.tangents(name, [[1, 1], [9, 9]]),  # NaN in the first row
        lambda: client.get_measures(name),
        lambda: client.separate(name, name),
    ):
        first, second = ask(), ask()
        assert first == second
        assert len({first, second}) == 1
    assert client.locate(name, [[1, 1]]) != client.locate(name, [[9, 9]])
    assert Located(1, np.array([1])) != Located(1, np.array([1, 1]))
    nan = float("nan")
    assert Measures(0.0, 0.0, (nan, nan), (nan,) * 4) == Measures(0.0, 0.0, (-nan, nan), (nan,) * 4)
    assert hash(Tangents(1, np.array([[[0.0, nan]]]))) == hash(Tangents(1, np.array([[[-0.0, -nan]]])))
    assert Tangents(1, np.array([0.0])) != (1, [0.0])
    with pytest.raises(ValueError, match="read-only"):
        client.get_hull(name).vertices[0] = 7


def test_answers_print_on_a_line(client: HullClient, name: str, address: str) -> None:
    shown = (
        "Snapshot(revision=1, points=2, vertices=[[0.0, 1.0]], measures=None, uid='u', "
        "vertex_keys=None, cause='batch', clock=None, center=None, changed=None, erased=False)"
    )
    assert repr(Snapshot(1, 2, np.array([[0.0, 1.0]]), None, "u")) == shown
    client.apply(name, insert=[[i, i * i] for i in range(100)])
    assert "vertices=<array of shape (" in repr(client.get_hull(name))
    copy = HullCopy()
    with client.watch(name, copy=copy) as watch:
        next(watch)
    assert repr(copy) == f"<HullCopy at revision 2: 105 points, {len(copy.vertices)} vertices>"
    assert repr(HullClient(address)) == f"HullClient('{address}')"
    for stream in (client.writer(name), client.ingest(name), client.watch(name)):
        assert repr(name) in repr(getattr(stream, "_inner", stream))  # the asyncio client's stands behind an interface


def test_hulls_are_features_and_pictures(client: HullClient, name: str) -> None:
    client.apply(
        name, insert=geopandas.GeoSeries.from_xy([5], [2]), delete=pd.DataFrame({"y": [1], "x": [1], "id": [7]})
    )
    hull = client.get_hull(name)
    (row,) = geopandas.GeoDataFrame.from_features([hull]).itertuples()
    assert (row.name, row.revision, row.points, row.area) == (name, 2, 5, 18.0)
    copy = HullCopy()
    with client.watch(name, copy=copy) as watch:
        snapshot = next(watch)
    for each in (hull, copy, snapshot):
        assert shape(each).equals(row.geometry)
        assert client.locate(name, each).sides.tolist() == [0] * 5
    assert snapshot._repr_svg_().count("<circle") == copy._repr_svg_().count("<circle") == 5
    figure = hull._repr_html_()
    assert "5 points, 5 vertices, area 18" in figure
    assert ElementTree.fromstring(figure).find(".//{*}polygon") is not None
