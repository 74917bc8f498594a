"""Shared by the commands that connect to a server: the options of the connection, the client, and exit codes."""

import inspect
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn, TypeVar

import typer

from dynhull_surface.reasons import Exit, exit_of

from .completion import hulls
from .durations import more_than_0

if TYPE_CHECKING:
    from grpc import ChannelCredentials

    from dynhull_client import AsyncHullClient, DynhullError, HullClient

Client = TypeVar("Client", "HullClient", "AsyncHullClient")


@dataclass(frozen=True, slots=True)
class Connect:
    """Makes clients.

    Attributes:
        address: the server, as the user writes it.
        token: the bearer token, or None.
        encryption: the credentials of TLS, or None.
        ping_interval: seconds between questions whether the server is still there.
    """

    address: str
    token: str | None
    encryption: "ChannelCredentials | None"
    ping_interval: float

    def __call__(self, kind: type[Client], /, **more: Any) -> Client:
        """A client of the given class; `more` are further arguments of `Connection`."""
        return kind(self.address, token=self.token, tls=self.encryption, ping_interval=self.ping_interval, **more)


def _option(variable: str, text: str, **more: Any) -> Any:
    return typer.Option(envvar=f"DYNHULL_{variable}", help=text, rich_help_panel="Server", **more)


def _pem(variable: str, text: str) -> Any:
    return _option(variable, f"PEM file: {text}", exists=True, dir_okay=False)


Address = Annotated[
    str, _option("ADDRESS", "HOST or HOST:PORT; the port is 50051 unless given. https://HOST asks for TLS.")
]
GivenAddress = Annotated[
    str,
    typer.Option(
        help="Ask the server at HOST or HOST:PORT. https://HOST asks for TLS.",
        rich_help_panel="Server",
        show_default=False,
    ),
]
Token = Annotated[str | None, _option("TOKEN", "Bearer token.")]
Tls = Annotated[bool, _option("TLS", "Encrypt, and trust the certificates that this machine trusts.")]
TlsCa = Annotated[Path | None, _pem("TLS_CA", "encrypt, and trust these certificates.")]
ClientCert = Annotated[Path | None, _pem("CLIENT_CERT", "certificate of this client.")]
ClientKey = Annotated[Path | None, _pem("CLIENT_KEY", "private key of that certificate.")]
PingInterval = Annotated[
    str,
    _option(
        "PING_INTERVAL",
        "Pause between questions whether the server is still there. A connection without an answer for as long "
        "again is lost. Servers permit 5s or more (--min-ping-interval).",
    ),
]

HullName = Annotated[str, typer.Argument(metavar="HULL", help="Name of the hull.", autocompletion=hulls)]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON, one object per line.")]


def connected(command: Callable[..., None]) -> Callable[..., None]:
    """A typer command with the options of a connection; `command` receives the client as its first argument.

    An error ends it with a message that says what to do, and with the exit code of its kind. The SDK is imported when a
    command runs, because help and shell completion do without it.
    """

    @wraps(command)
    def with_client(connect: Connect, **given: Any) -> None:
        from dynhull_client import HullClient

        with connect(HullClient) as client:
            command(client, **given)

    return connecting(with_client)


def connecting(command: Callable[..., None], *, optional: bool = False) -> Callable[..., None]:
    """As `connected`, but the first argument is a function that makes a client, synchronous or asyncio.

    With `optional`, for commands that can do without a server, its address is empty unless --address is given.
    """

    def run(
        *,
        address: Address = "127.0.0.1:50051",
        token: Token = None,
        tls: Tls = False,
        tls_ca: TlsCa = None,
        client_cert: ClientCert = None,
        client_key: ClientKey = None,
        ping_interval: PingInterval = "10s",
        **given: Any,
    ) -> None:
        os.environ.setdefault("GRPC_VERBOSITY", "NONE")  # what gRPC would log, the message of the error says

        import dynhull_client as sdk

        from .certificates import credentials

        try:
            encryption = credentials(tls, tls_ca, client_cert, client_key)
            seconds = more_than_0(ping_interval, "--ping-interval")
            command(Connect(address, token, encryption, seconds), **given)
        except sdk.DynhullError as error:
            encrypted = bool(tls or tls_ca or client_cert or address.startswith(("https:", "grpcs:")))
            fail(exit_of(type(error)), _said(error, address, has_token=token is not None, encrypted=encrypted))
        except OSError as error:
            fail(Exit.UNUSABLE, f"{error.filename}: {error.strerror}" if error.filename else str(error))
        except (ValueError, TypeError) as error:
            fail(Exit.UNUSABLE, str(error))

    own = list(inspect.signature(command).parameters.values())[1:]
    shared = [each for each in inspect.signature(run).parameters.values() if each.kind is each.KEYWORD_ONLY]
    if optional:
        address = shared[0].replace(annotation=GivenAddress, default="")
        shared = [address, *shared[1:]]
    parameters = [each.replace(kind=inspect.Parameter.KEYWORD_ONLY) for each in own] + shared
    run.__doc__, run.__name__ = command.__doc__, command.__name__
    run.__annotations__ = {each.name: each.annotation for each in parameters}
    run.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    return run


def _said(error: "DynhullError", address: str, *, has_token: bool, encrypted: bool) -> str:
    """The message of an error of the SDK, with what to do about it."""
    import dynhull_client as sdk

    match error:
        case sdk.UnavailableError() | sdk.DeadlineError():
            if error.reason:  # which only our server gives
                return f"the server at {address} answers, but cannot do this now: {error}"
            about_tls = "does it serve TLS" if encrypted else "does it require TLS (--tls)"
            advice = f"Is it running (dynhull serve), is the address right (--address), {about_tls}?"
            if "CERTIFICATE_VERIFY_FAILED" in str(error):
                advice = (
                    "This machine does not trust the server's certificate: name its authority's file with --tls-ca."
                )
            return f"no answer from {address}: {error}\n{advice}"
        case sdk.UnauthenticatedError():
            if has_token:
                return "the server does not know the given token: give another one with --token or in DYNHULL_TOKEN"
            return "the server requires a token: give one with --token or in DYNHULL_TOKEN"
        case sdk.HullNotFoundError():
            return f"{error}\n`dynhull list` shows the hulls of the server, `dynhull create` adds one."
        case sdk.FenceNotFoundError():
            return f"{error}\n`dynhull fences list` shows the fences of the server."
        case sdk.AlarmNotFoundError():
            return f"{error}\n`dynhull alarms list` shows the alarms of the server."
        case sdk.InvalidRequestError():
            from .fields import in_options

            return in_options(error)
        case sdk.LimitExceededError() if error.metadata.get("limit") == "max_points":  # an option for windows
            where = "(--point-limit of the hull, or --max-points of `dynhull serve`)"
            return f"the limit on the points of the hull is {error.value} {where}"
    return str(error)


def fail(code: Exit, message: str) -> NoReturn:
    """Print an error and end the command."""
    typer.echo(f"error: {message}", err=True)
    sys.exit(code)
