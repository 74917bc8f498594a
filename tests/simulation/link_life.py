"""One life of the real engine behind a gateway's link: requests are frames on a simulated network, which may be dark.

What is real are the link, the frames of both ends, the handlers of the service and the engine. Calls that stream, as
those of listeners, use gRPC between gateway and worker, which is not simulated.
"""

import asyncio
import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status

from dynhull_cluster.again import reason_of
from dynhull_cluster.frame_server import FrameServer
from dynhull_cluster.machines.addresses import Addresses
from dynhull_cluster.machines.board import Owner, Tables
from dynhull_cluster.machines.entrance import proof_of
from dynhull_cluster.worker_link import WorkerLink
from dynhull_proto.v1 import batch_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.engine.engine import Engine
from dynhull_server.rpc.access import ANONYMOUS
from dynhull_server.rpc.calls import Calls
from dynhull_server.rpc.hull_service import HullService
from dynhull_server.rpc.many import ManyQuotas
from dynhull_server.rpc.methods import hull_handlers
from dynhull_server.rpc.metrics import Metrics
from dynhull_server.rpc.places import Places, Unread
from dynhull_server.rpc.status import RelayedError, WorkerAwayError
from dynhull_server.settings import Settings
from dynhull_server.state.batch import Applied, Batch, Write
from dynhull_server.state.errors import (
    HullExistsError,
    HullNotFoundError,
    HullReplacedError,
    LimitExceededError,
    NotStoredError,
    OutcomeUnknownError,
    PastDamagedError,
    RevisionForgottenError,
    SequenceGapError,
)

from .clients import Client, Outline
from .cluster_plan import Operation
from .network import TO_GATEWAY, TO_WORKER, Network, NetworkLoop
from .queries import MOST_BYTES, MOST_CALLS, _outline, _read
from .shell_life import ShellServer

PARTITION, WORKER, SECRET = 0, "north/0", "secret"
# Seconds between the pings of a link.
PING = 1.0
SERVICE = "/dynhull.v1.HullService/"
CALL: Any = SimpleNamespace(owner="owner", caller=SimpleNamespace(key=""))
DIRECTIONS = {"there": [TO_WORKER], "back": [TO_GATEWAY], "both": [TO_WORKER, TO_GATEWAY]}


class Ways(Addresses):
    def channel(self, _: int) -> Any:
        """A channel that nobody uses: no call streams."""

        async def close() -> None:
            pass

        return SimpleNamespace(close=close)


async def listen(engine: Engine, proof: str, entitled: Callable[[], bool] = lambda: True) -> tuple[FrameServer, Calls]:
    """Have the handlers of the service answer frames, from whoever begins with the proof."""
    metrics = Metrics()
    service = HullService(
        engine.driver,
        engine.hulls,
        metrics,
        ManyQuotas(Settings()),
        Places("max_past_reads", MOST_CALLS, MOST_CALLS),
        Places("max_replays", MOST_CALLS, MOST_CALLS),
        Places("max_feeds", MOST_CALLS, MOST_CALLS),
        create_on_write=True,
        max_watch_lag=math.inf,
    )
    places = Places("max_streams", MOST_CALLS, MOST_CALLS)
    calls = Calls(lambda _: ANONYMOUS, metrics, MOST_BYTES, places, Unread(MOST_BYTES), entitled)
    calls.ready()
    frames = FrameServer([hull_handlers(service, calls)], {}, proof.encode())
    bound: Any = None
    await frames.listen_on(bound, None)
    return frames, calls


class Asking:
    """Asks a server through the link of a gateway."""

    _link: WorkerLink

    async def _ask(self, method: str, request: Any, response: Any) -> Any:
        try:
            answer = await self._link.ask(SERVICE + method, CALL, request.SerializeToString())
        except WorkerAwayError as error:
            raise NotStoredError(str(error)) from error
        except RelayedError as error:
            raise _refusal(error.status, request) from error
        return response.FromString(answer)

    async def apply(self, write: Write, *, create: bool, uid: str = "") -> Applied:  # noqa: ARG002
        request = pb.ApplyRequest(name=write.name, producer=write.producer, sequence=write.sequence, uid=uid)
        batch = write.batch
        assert isinstance(batch, Batch)
        request.batch.inserts.packed = batch.inserts.astype("<f8").tobytes()
        if len(batch.deletes):
            request.batch.deletes.packed = batch.deletes.astype("<f8").tobytes()
            request.batch.missing_points = batch_pb2.MISSING_POINT_POLICY_COUNT
        result = (await self._ask("Apply", request, pb.ApplyResponse)).result
        return Applied(result.revision, 0, 0, 0, result.hull_changed, result.point_count, result.duplicate)

    async def vertices(self, name: str, rows: int) -> tuple[str, int, Outline]:  # noqa: ARG002
        response = await self._ask("GetHull", _read({"name": name}).get_hull, pb.GetHullResponse)
        return response.hull.uid, response.hull.revision, _outline(response)

    async def last(self, name: str, producer: str) -> int:
        request = pb.GetProducerRequest(name=name, producer=producer)
        return int((await self._ask("GetProducer", request, pb.GetProducerResponse)).last_sequence)

    def is_linked(self) -> bool:
        """Whether the link has a connection that carries what is sent."""
        connection = self._link._connection
        wire: Any = None if connection is None else connection.frames._transport
        return wire is not None and wire.open and not (wire.lost or wire.other.lost)


async def disturb(network: Network, client: Client, op: Operation) -> bool:
    """Many calls at once, or what becomes of the network; whether the operation is one of these."""
    match op["do"]:
        case "burst":
            calls = [{**op, "do": do} for do in ("write", "read", "write")] * op["calls"]
            await asyncio.gather(*map(client.do, calls))
        case "cut":
            network.cut()
        case "dark" if op["seconds"] is None:
            network.lose(DIRECTIONS[op["way"]])
        case "dark":
            network.dark = [each in DIRECTIONS[op["way"]] for each in (TO_WORKER, TO_GATEWAY)]
            try:
                await asyncio.sleep(op["seconds"])
            finally:
                network.dark = [False, False]
        case _:
            return False
    return True


class LinkedServer(Asking, ShellServer):
    """Drives an Engine through a link."""

    loop: NetworkLoop
    loop_type = NetworkLoop

    async def _start(self) -> None:
        await super()._start()
        await listen(self._engine, proof_of(PARTITION, WORKER, SECRET))
        ways = Ways(SECRET, None, PING)
        ways.learn(Tables({PARTITION: Owner(1, WORKER, "", "machine 1 1", "", False, True)}, {}, {}, {}, PARTITION + 1))
        self._link = WorkerLink(PARTITION, ways, (), lambda: None)
        self.loop.create_task(self._link.run())

    async def special(self, client: Client, op: Operation) -> None:
        """Many calls at once, time that passes, or what becomes of the network."""
        if not await disturb(self.loop.network, client, op):
            await super().special(client, op)

    # Its life

    def client(self, client: Client, operations: list[Operation]) -> None:
        """Add a client."""
        self.model.faulty = self.model.repeats = self.loop.network.hasty = True
        super().client(client, operations)

    def check(self) -> None:
        """Compare what is in memory with the truth; whoever asked on a connection that is dark has another one."""
        self.loop.network.hasty = False
        super().check()
        self._until(self.is_linked, "the link")


def _refusal(status: Status, request: Any) -> Exception:
    """The error of the server that has become a status."""
    match reason_of(status):
        case "" | "OUTCOME_UNKNOWN":
            return OutcomeUnknownError(status.message)
        case "STARTING" | "DRAINING":
            return NotStoredError(status.message)
        case "HULL_NOT_FOUND":
            return HullNotFoundError(request.name)
        case "HULL_EXISTS":
            return HullExistsError(request.name)
        case "HULL_REPLACED":
            return HullReplacedError(request.name, "", "at_uid")
        case "REVISION_FORGOTTEN":
            return RevisionForgottenError(request.at_revision, 0, 0)
        case "STORAGE_FAILED":
            return NotStoredError(status.message)
        case "PAST_DAMAGED":
            return PastDamagedError(status.message)
        case "LIMIT_EXCEEDED":
            return LimitExceededError(_metadata(status)["limit"], float(_metadata(status)["value"]))
        case "SEQUENCE_GAP":
            return SequenceGapError(request.producer, request.sequence, int(_metadata(status)["expected"]))
        case reason:
            return RuntimeError(f"{reason}: {status.message}")


def _metadata(status: Status) -> dict[str, str]:
    info = ErrorInfo()
    any(detail.Unpack(info) for detail in status.details)
    return dict(info.metadata)
