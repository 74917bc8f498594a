"""Clients of a dynhull server, with numpy arrays in and out: HullClient, and AsyncHullClient for asyncio.

>>> from dynhull_client import HullClient
>>> with HullClient("127.0.0.1:50051") as client:  # doctest: +SKIP
...     client.create_hull("fleet")
...     client.apply("fleet", insert=[[0, 0], [4, 0], [2, 3]])
...     print(client.get_hull("fleet").vertices)
"""

try:
    import google.protobuf as _protobuf  # noqa: F401
    import grpc as _grpc  # noqa: F401
except ModuleNotFoundError as _missing:
    raise ModuleNotFoundError(
        "dynhull_client needs grpcio and protobuf. Install them with: pip install 'dynhull[client]'", name=_missing.name
    ) from None

from . import _errors
from ._alarm_messages import Alarm, AlarmEvent, AlarmStatus
from ._areas import Circle, Polygon, Prefix
from ._async_client import AsyncHullClient
from ._async_ingest import AsyncIngest
from ._async_past import AsyncPast
from ._async_pipeline import AsyncPipeline
from ._async_watch import (
    AsyncAlarmWatch,
    AsyncFeed,
    AsyncFenceEvents,
    AsyncFenceWatch,
    AsyncManyWatch,
    AsyncReplay,
    AsyncWatch,
)
from ._async_writer import AsyncWriter
from ._batch import Batch
from ._client import HullClient
from ._errors import *  # noqa: F403  # all of them: `_errors.__all__`
from ._feed_messages import FeedBatch, FeedConsumer, FeedHeld
from ._fence_messages import Fence, FenceConsumer, FenceEvent, Inside, SubjectsInside
from ._history_messages import Erasure, History
from ._hull_copies import HullCopies
from ._hull_copy import HullCopy
from ._ingest import Ingest
from ._layers import Influence, Layers
from ._many_messages import ManyChange
from ._messages import (
    Applied,
    Change,
    ChanRound,
    Counted,
    Crossings,
    Deleted,
    Difference,
    Distances,
    Entities,
    Event,
    FenceDifference,
    Hull,
    HullInfo,
    Ingested,
    Located,
    Measures,
    Points,
    Positions,
    Progress,
    Sampled,
    Sketch,
    Snapshot,
    Stored,
    Supported,
    Tangents,
    Verification,
    Window,
)
from ._pipeline import Pipeline
from ._quarantine_messages import HeldPosition, Quarantine
from ._series import Series
from ._sync_past import Past
from ._tracks import Track
from ._uses import Efficient, Measured, Phases, Separation
from ._watch import AlarmWatch, Feed, FenceEvents, FenceWatch, ManyWatch, Replay, Watch
from ._writer import Writer

__all__ = [
    "Alarm",
    "AlarmEvent",
    "AlarmStatus",
    "AlarmWatch",
    "Applied",
    "AsyncAlarmWatch",
    "AsyncFeed",
    "AsyncFenceEvents",
    "AsyncFenceWatch",
    "AsyncHullClient",
    "AsyncIngest",
    "AsyncManyWatch",
    "AsyncPast",
    "AsyncPipeline",
    "AsyncReplay",
    "AsyncWatch",
    "AsyncWriter",
    "Batch",
    "ChanRound",
    "Change",
    "Circle",
    "Counted",
    "Crossings",
    "Deleted",
    "Difference",
    "Distances",
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
    "FenceEvents",
    "FenceWatch",
    "HeldPosition",
    "History",
    "Hull",
    "HullClient",
    "HullCopies",
    "HullCopy",
    "HullInfo",
    "Influence",
    "Ingest",
    "Ingested",
    "Inside",
    "Layers",
    "Located",
    "ManyChange",
    "ManyWatch",
    "Measured",
    "Measures",
    "Past",
    "Phases",
    "Pipeline",
    "Points",
    "Polygon",
    "Positions",
    "Prefix",
    "Progress",
    "Quarantine",
    "Replay",
    "Sampled",
    "Separation",
    "Series",
    "Sketch",
    "Snapshot",
    "Stored",
    "SubjectsInside",
    "Supported",
    "Tangents",
    "Track",
    "Verification",
    "Watch",
    "Window",
    "Writer",
    "__version__",
]
__all__ += _errors.__all__

__version__: str
"""The version of the installed distribution."""

# Tracebacks and help show where to import a name from, not the private module that defines it.
for _exported in [each for each in globals().values() if isinstance(each, type)]:
    for _named in (_exported, *vars(_exported).values()):
        if isinstance(_named, type) or hasattr(_named, "__code__"):
            _named.__module__ = __name__


def __getattr__(name: str) -> str:
    if name == "__version__":
        import dynhull

        return dynhull.__version__
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
