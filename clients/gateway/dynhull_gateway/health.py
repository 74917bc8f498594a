"""Whether the gateway lives, and whether it can answer."""

import asyncio
from http import HTTPStatus

from fastapi import APIRouter, Request, Response

from dynhull_client import DynhullError, PermissionDeniedError, UnauthenticatedError

from . import schemas
from .bodies import JsonRoute

router = APIRouter(tags=["health"], route_class=JsonRoute)
SECONDS = 2.0


class State:
    """Whether the gateway is about to end."""

    def __init__(self) -> None:
        self.draining = asyncio.Event()

    def drain(self) -> None:
        """The gateway is about to end; called by a handler of signals."""
        self.draining.set()


@router.get("/livez", response_model=schemas.Health)
async def livez() -> schemas.Health:
    """Whether the process answers."""
    return schemas.Health(status="ok")


@router.get("/readyz", response_model=schemas.Health)
async def readyz(request: Request, response: Response) -> schemas.Health:
    """Whether the gateway accepts work and the server behind it answers. 503 if not."""
    state: State = request.app.state.health
    status = "draining" if state.draining.is_set() else "ok" if await _server_answers(request) else "unavailable"
    if status != "ok":
        response.status_code = HTTPStatus.SERVICE_UNAVAILABLE
    return schemas.Health.model_validate({"status": status})


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
