"""Client of the dynhull server: numpy arrays in and out.

>>> from dynhull_client import HullClient
>>> with HullClient("127.0.0.1:50051") as client:  # doctest: +SKIP
...     client.create_hull("fleet")
...     client.apply("fleet", insert=[[0, 0], [4, 0], [2, 3]])
...     print(client.get_hull("fleet").vertices)
"""

from .async_client import AsyncHullClient
from .async_ingest import AsyncIngest
from .async_watch import AsyncWatch
from .async_writer import AsyncWriter
from .client import HullClient
from .errors import (
    DeadlineError,
    DynhullError,
    HullEmptyError,
    HullExistsError,
    HullNotFoundError,
    HullReplacedError,
    HullUnsuitableError,
    InvalidRequestError,
    LimitExceededError,
    OutcomeUnknownError,
    PermissionDeniedError,
    PointMissingError,
    ProducerInUseError,
    RevisionForgottenError,
    SequenceGapError,
    UnauthenticatedError,
    UnavailableError,
)
from .hull_copy import HullCopy
from .ingest import Ingest
from .messages import (
    Applied,
    Change,
    ChanRound,
    Counted,
    Crossings,
    Deleted,
    Difference,
    Distances,
    Event,
    Hull,
    HullInfo,
    Ingested,
    Located,
    Measures,
    Progress,
    Sampled,
    Sketch,
    Snapshot,
    Supported,
    Tangents,
    Verification,
)
from .uses import Efficient, Measured, Phases, Separation
from .watch import Watch
from .writer import Writer

__all__ = [
    "Applied",
    "AsyncHullClient",
    "AsyncIngest",
    "AsyncWatch",
    "AsyncWriter",
    "ChanRound",
    "Change",
    "Counted",
    "Crossings",
    "DeadlineError",
    "Deleted",
    "Difference",
    "Distances",
    "DynhullError",
    "Efficient",
    "Event",
    "Hull",
    "HullClient",
    "HullCopy",
    "HullEmptyError",
    "HullExistsError",
    "HullInfo",
    "HullNotFoundError",
    "HullReplacedError",
    "HullUnsuitableError",
    "Ingest",
    "Ingested",
    "InvalidRequestError",
    "LimitExceededError",
    "Located",
    "Measured",
    "Measures",
    "OutcomeUnknownError",
    "PermissionDeniedError",
    "Phases",
    "PointMissingError",
    "ProducerInUseError",
    "Progress",
    "RevisionForgottenError",
    "Sampled",
    "Separation",
    "SequenceGapError",
    "Sketch",
    "Snapshot",
    "Supported",
    "Tangents",
    "UnauthenticatedError",
    "UnavailableError",
    "Verification",
    "Watch",
    "Writer",
    "__version__",
]

__version__: str


def __getattr__(name: str) -> str:
    if name == "__version__":
        import dynhull

        return dynhull.__version__
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
