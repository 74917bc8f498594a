"""Query calls: the server's own handler on a simulated engine, and a client that compares answers with the model."""

import asyncio
import math
from collections import deque
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import grpc
import numpy as np
from google.rpc import code_pb2

from dynhull.keys import PackedKeys
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2
from dynhull_server.engine.engine import Engine
from dynhull_server.rpc.access import ANONYMOUS
from dynhull_server.rpc.calls import Calls
from dynhull_server.rpc.hull_service import HullService
from dynhull_server.rpc.many import ManyQuotas
from dynhull_server.rpc.metrics import Metrics
from dynhull_server.rpc.places import Places, Unread
from dynhull_server.settings import Settings
from dynhull_server.state.errors import HullNotFoundError, StoppingError

from .clients import Client, Outline
from .cluster_plan import Operation
from .model import Asked, Model
from .operations import TIMED

if TYPE_CHECKING:
    from .entities import Key

MOST_CALLS, MOST_BYTES = 100, 2**22


class Queries:
    """What answers Query calls.

    Args:
        engine: the hulls.
        model: judges the answers.
    """

    def __init__(self, engine: Engine, model: Model) -> None:
        self._model = model
        metrics = Metrics()
        quotas = ManyQuotas(Settings())
        pasts = [Places(limit, MOST_CALLS, MOST_CALLS) for limit in ("max_past_reads", "max_replays", "max_feeds")]
        self._service = HullService(
            engine.driver, engine.hulls, metrics, quotas, *pasts, create_on_write=False, max_watch_lag=math.inf
        )
        places = Places("max_streams", MOST_CALLS, MOST_CALLS)
        self._calls = Calls(lambda _: ANONYMOUS, metrics, MOST_BYTES, places, Unread(MOST_BYTES))
        self._calls.ready()

    async def ask(self, client: Client, op: Operation) -> None:
        """One call: its messages, and the answers in the same order."""
        context = _Context(client, self._model, [list(map(_read, message)) for message in op["messages"]])
        call: Any = self._calls.admit(context)  # type: ignore[arg-type]  # it has what the call needs
        try:
            await self._service.Query(None, call)
        except StoppingError as error:
            for _, asked in context.under_way:
                client.refused(asked, error, ())
            return
        if context.under_way:
            raise self._model.finds(f"a Query call ended before {len(context.under_way)} of its reads were answered")


class _Context:
    """One call as its handler sees it. Its client reads what is sent, and writes its messages one after the other.

    Attributes:
        under_way: the reads that are not answered.
    """

    def __init__(self, client: Client, model: Model, messages: Sequence[Sequence[pb.Read]]) -> None:
        self.under_way: deque[tuple[pb.Read, Asked]] = deque()
        self._client = client
        self._model = model
        self._messages = deque(messages)
        # The uid and the revision last seen of each hull, and what was located in it since.
        self._seen: dict[str, tuple[str, int]] = {}
        self._located: dict[str, list[tuple[Asked, pb.LocateRequest, pb.LocateResponse]]] = {}

    def peer(self) -> str:
        """The address of the client."""
        return f"simulated:{self._client.producer}"

    async def read(self) -> Any:
        """The next message, and its size."""
        await asyncio.sleep(0)
        if not self._messages:
            return grpc.aio.EOF
        reads = self._messages.popleft()
        self.under_way += [(read, self._model.ask(_name(read))) for read in reads]
        message = pb.QueryRequest(reads=reads)
        return message, message.ByteSize()

    async def send_initial_metadata(self, _: Any) -> None:
        """Begin the response."""
        await asyncio.sleep(0)

    async def write(self, data: bytes) -> None:
        """Take answers."""
        for answer in pb.QueryResponse.FromString(data).answers:
            if not self.under_way:
                raise self._model.finds(f"an answer without a read: {answer}")
            read, asked = self.under_way.popleft()
            kind = answer.WhichOneof("answer")
            if kind == "error":
                self._refused(asked, answer.error)
            elif kind != read.WhichOneof("read"):
                raise self._model.finds(f"a read was answered out of order: {read} with {answer}")
            elif kind == "get_hull":
                self._saw(asked, answer.get_hull)
            else:
                self._located.setdefault(asked.name, []).append((asked, read.locate, answer.locate))
        await asyncio.sleep(0)

    def _refused(self, asked: Asked, error: Any) -> None:
        self._located.pop(asked.name, None)
        if error.code == code_pb2.NOT_FOUND:
            self._client.refused(asked, HullNotFoundError(asked.name), (HullNotFoundError,))
        elif self._model.faulty and error.code == code_pb2.UNAVAILABLE:
            self._model.refused(asked)
        else:
            raise self._model.finds(f"a read was refused without a reason: {error}")

    def _saw(self, asked: Asked, response: pb.GetHullResponse) -> None:
        hull, name = response.hull, asked.name
        uid, revision = self._seen.get(name, ("", 0))
        if uid == hull.uid:
            if hull.revision < revision:
                raise self._model.finds(f"{name} was answered at revision {revision}, then at {hull.revision}")
            for each, request, located in self._located.get(name, ()):
                if not revision <= located.revision <= hull.revision:
                    found = f"{revision}, {located.revision}, {hull.revision}"
                    raise self._model.finds(f"{name} was answered at these revisions, one after the other: {found}")
                sides = np.frombuffer(located.sides, np.int8).tolist()
                places = np.frombuffer(request.points.packed).reshape(-1, 2)[:, 0].tolist()
                self._model.located(each, uid, located.revision, places, sides)
        self._located.pop(name, None)
        self._seen[name] = hull.uid, hull.revision
        self._client.saw(asked, hull.uid, hull.revision, _outline(response))


def _read(read: Operation) -> pb.Read:
    """A read of a plan: where points of the parabola are, or the hull with its vertices."""
    if "at" in read:
        xy = np.array([[x, x * x] for x in read["at"]], "<f8")
        return pb.Read(locate=pb.LocateRequest(name=read["name"], points={"packed": xy.tobytes()}))
    request = pb.GetHullRequest(
        name=read["name"],
        view=pb.HULL_VIEW_FULL,
        include_keys=TIMED.get(read["name"], "multiset") != "multiset",
        encoding=points_pb2.POINT_ENCODING_PACKED,
    )
    return pb.Read(get_hull=request)


def _name(read: pb.Read) -> str:
    name: str = getattr(read, read.WhichOneof("read") or "").name
    return name


def _outline(response: pb.GetHullResponse) -> Outline:
    hull, keys = response.hull, response.vertex_keys
    found: list[Key] | None = None
    if response.HasField("vertex_keys"):
        found = [*PackedKeys(keys.lengths, keys.text), *np.frombuffer(keys.packed_integers, "<u8").tolist()]
    center = (hull.center.longitude, hull.center.latitude) if hull.HasField("center") else None
    return np.frombuffer(response.vertices.packed, "<f8").reshape(-1, 2), found, center
