"""One life of the real engine behind a gateway's link: requests are frames on a simulated network, which may be dark.

What is real are the link, the frames of both ends, the handlers of the service and the engine. Calls that stream, as
those of listeners, use gRPC between gateway and worker, which is not simulated.
"""

import asyncio
import math
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
from dynhull_proto.v1 import hull_service_pb2 as pb
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
from dynhull_server.state.errors import HullNotFoundError, NotStoredError, OutcomeUnknownError, SequenceGapError

from .clients import Client, Outline
from .cluster_plan import Operation
from .network import TO_GATEWAY, TO_WORKER, NetworkLoop
from .queries import MOST_BYTES, MOST_CALLS, _outline, _read
from .shell_life import ShellServer

PARTITION, WORKER, SECRET = 0, "north/0", "secret"
# Seconds between the pings of a link.
PING = 1.0
SERVICE = "/dynhull.v1.HullService/"
CALL: Any = SimpleNamespace(owner="owner", caller=SimpleNamespace(key=""))
DIRECTIONS = {"there": [TO_WORKER], "back": [TO_GATEWAY], "both": [TO_WORKER, TO_GATEWAY]}


class _Ways(Addresses):
    def channel(self, _: int) -> Any:
        """A channel that nobody uses: no call streams."""

        async def close() -> None:
            pass

        return SimpleNamespace(close=close)


class LinkedServer(ShellServer):
    """Drives an Engine through a link."""

    loop: NetworkLoop
    loop_type = NetworkLoop

    async def _start(self) -> None:
        await super()._start()
        metrics = Metrics()
        service = HullService(
            self._engine.driver,
            self._engine.hulls,
            metrics,
            ManyQuotas(Settings()),
            Places("max_past_reads", MOST_CALLS, MOST_CALLS),
            Places("max_replays", MOST_CALLS, MOST_CALLS),
            Places("max_feeds", MOST_CALLS, MOST_CALLS),
            create_on_write=True,
            max_watch_lag=math.inf,
        )
        places = Places("max_streams", MOST_CALLS, MOST_CALLS)
        calls = Calls(lambda _: ANONYMOUS, metrics, MOST_BYTES, places, Unread(MOST_BYTES))
        calls.ready()
        frames = FrameServer([hull_handlers(service, calls)], {}, proof_of(PARTITION, WORKER, SECRET).encode())
        bound: Any = None
        await frames.listen_on(bound, None)
        ways = _Ways(SECRET, None, PING)
        ways.learn(Tables({PARTITION: Owner(1, WORKER, "", "machine 1 1", "", False, True)}, {}, {}, {}, PARTITION + 1))
        self._link = WorkerLink(PARTITION, ways, (), lambda: None)
        self.loop.create_task(self._link.run())

    # What clients ask for

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
        result = (await self._ask("Apply", request, pb.ApplyResponse)).result
        return Applied(result.revision, 0, 0, 0, result.hull_changed, result.point_count, result.duplicate)

    async def vertices(self, name: str, rows: int) -> tuple[str, int, Outline]:  # noqa: ARG002
        response = await self._ask("GetHull", _read({"name": name}).get_hull, pb.GetHullResponse)
        return response.hull.uid, response.hull.revision, _outline(response)

    async def last(self, name: str, producer: str) -> int:
        request = pb.GetProducerRequest(name=name, producer=producer)
        return int((await self._ask("GetProducer", request, pb.GetProducerResponse)).last_sequence)

    async def special(self, client: Client, op: Operation) -> None:
        """Many calls at once, time that passes, or what becomes of the network."""
        network = self.loop.network
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
        self._until(self._is_linked, "the link")

    def _is_linked(self) -> bool:
        connection = self._link._connection
        wire: Any = None if connection is None else connection.frames._transport
        return wire is not None and wire.open and not (wire.lost or wire.other.lost)


def _refusal(status: Status, request: Any) -> Exception:
    """The error of the server that has become a status."""
    match reason_of(status):
        case "":
            return OutcomeUnknownError(status.message)
        case "STARTING" | "DRAINING":
            return NotStoredError(status.message)
        case "HULL_NOT_FOUND":
            return HullNotFoundError(request.name)
        case "SEQUENCE_GAP":
            info = ErrorInfo()
            any(detail.Unpack(info) for detail in status.details)
            return SequenceGapError(request.producer, request.sequence, int(info.metadata["expected"]))
        case reason:
            return RuntimeError(f"{reason}: {status.message}")
