"""Who calls: the token of a request is passed on to the server."""

from http import HTTPStatus
from typing import Annotated

from fastapi import Depends, Request
from fastapi.security import HTTPBearer

from dynhull_client import AsyncHullClient

from .problems import ProblemError

SCHEME = "bearer "
LONGEST_TOKEN = 8192  # gRPC refuses calls with more metadata

described = HTTPBearer(auto_error=False, description="A token of the server (`dynhull token`), passed on as it is.")


def token_of(request: Request) -> str | None:
    """The bearer token of a request; None without."""
    return bearer(request.headers.get("authorization"))


def bearer(given: str | None) -> str | None:
    """The token in the header of that name; None without."""
    if given is None:
        return None
    if given[: len(SCHEME)].lower() != SCHEME:
        raise ProblemError(HTTPStatus.UNAUTHORIZED, "Authorization must be Bearer and a token", "UNAUTHENTICATED")
    token = given[len(SCHEME) :].strip()
    if len(token) > LONGEST_TOKEN:
        detail = f"a token has at most {LONGEST_TOKEN} characters, not {len(token)}"
        raise ProblemError(HTTPStatus.UNAUTHORIZED, detail, "UNAUTHENTICATED")
    return token


def address_of(request: Request) -> str:
    """The address of a caller: that which a proxy has said, where it is believed."""
    return "" if request.client is None else request.client.host


def client_of(request: Request) -> AsyncHullClient:
    """The client that calls with the token of the request, or with the gateway's own if it has none."""
    return client_with(request.app.state.client, token_of(request))


def client_with(client: AsyncHullClient, token: str | None) -> AsyncHullClient:
    """The client that calls with a token, or the gateway's own without."""
    if token is None:
        return client
    try:
        return client.with_token(token)
    except ValueError as error:
        raise ProblemError(HTTPStatus.UNAUTHORIZED, str(error), "UNAUTHENTICATED") from None


async def _caller(request: Request, _: Annotated[object, Depends(described)]) -> AsyncHullClient:
    return client_of(request)


Caller = Annotated[AsyncHullClient, Depends(_caller)]
