"""Whether the gateway lives, and whether it can answer."""

import asyncio
from collections.abc import AsyncIterator
from http import HTTPStatus
from time import monotonic

from fastapi import APIRouter, Request, Response

from dynhull_client import DynhullError, PermissionDeniedError, UnauthenticatedError

from . import schemas
from .bodies import JsonRoute

router = APIRouter(tags=["health"], route_class=JsonRoute)
SECONDS = 2.0


class State:
    """Whether the gateway is about to end, and whether it has its server.

    Attributes:
        draining: set when it is about to end.
        connected: whether it has its server; True at first, until `follow` knows better.
        changed: set, and replaced by another one, when that changes.
    """

    def __init__(self) -> None:
        self.draining = asyncio.Event()
        self.connected = True
        self.changed = asyncio.Event()
        self._lost = monotonic()

    @property
    def seconds_without_server(self) -> float | None:
        """How long the gateway has been without its server; None while it has it."""
        return None if self.connected else monotonic() - self._lost

    async def follow(self, presence: AsyncIterator[bool]) -> None:
        """Learn whether the server is connected, as long as anybody knows."""
        async for connected in presence:
            if connected is not self.connected:
                self.connected, self._lost = connected, monotonic()
                self.changed.set()
                self.changed = asyncio.Event()

    def drain(self) -> None:
        """The gateway is about to end; called by a handler of signals."""
        self.draining.set()


@router.get("/livez", response_model=schemas.Health)
async def livez(request: Request) -> schemas.Health:
    """Whether the process answers; and how long it has been without its server, for which nobody should end it."""
    return schemas.Health(status="ok", seconds_without_server=request.app.state.health.seconds_without_server)


@router.get("/readyz", response_model=schemas.Health)
async def readyz(request: Request, response: Response) -> schemas.Health:
    """Whether the gateway accepts work and the server behind it answers. 503 if not."""
    state: State = request.app.state.health
    status = "draining" if state.draining.is_set() else "ok" if await _server_answers(request) else "unavailable"
    if status != "ok":
        response.status_code = HTTPStatus.SERVICE_UNAVAILABLE
    return schemas.Health.model_validate({"status": status, "seconds_without_server": state.seconds_without_server})


async def _server_answers(request: Request) -> bool:
    """Whether the server answers, be it with a refusal."""
    try:
        async for _ in request.app.state.client.list_hulls(timeout=SECONDS):
            break
    except (UnauthenticatedError, PermissionDeniedError):
        return True
    except DynhullError:
        return False
    return True
