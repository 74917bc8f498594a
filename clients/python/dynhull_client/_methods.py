"""What the methods of both clients have in common: they are made of functions as those in `_calls` and `_uses`."""

import inspect
from collections.abc import Callable, Collection
from copy import copy
from functools import cache
from typing import Any, Concatenate, Generic, ParamSpec, Self, TypeVar

import grpc

from ._arguments import require_not_negative
from ._connection import DEFAULT_ADDRESS, DEFAULT_PING_INTERVAL, DEFAULT_RETRIES, DEFAULT_TIMEOUT, Connection, Dialling

P = ParamSpec("P")
Description = TypeVar("Description")
Stream = TypeVar("Stream")
AnyConnection = TypeVar("AnyConnection", bound=Connection)

Function = Callable[..., Any]

NOT_NEGATIVE = {
    "after",
    "confirmations",
    "max_events",
    "min_revision",
    "other_min_revision",
    "sequence",
    "timeout",
}


class Client(Generic[AnyConnection]):
    """What `HullClient` and `AsyncHullClient` have in common."""

    _connect: type[AnyConnection]

    def __init__(
        self,
        address: str = DEFAULT_ADDRESS,
        *,
        timeout: float | None = DEFAULT_TIMEOUT,
        wait_for_ready: bool = False,
        token: str | None = None,
        tls: grpc.ChannelCredentials | None = None,
        retries: int = DEFAULT_RETRIES,
        ping_interval: float = DEFAULT_PING_INTERVAL,
        read_ahead: int | None = None,
    ) -> None:
        dialling = Dialling(timeout, wait_for_ready, token, tls, retries, ping_interval, read_ahead)
        self._connection = self._connect(address, dialling)

    @property
    def address(self) -> str:
        """The server's host:port."""
        return self._connection.address

    def with_token(self, token: str | None) -> Self:
        """A client on the same connection that sends another bearer token; None for none.

        For programs that call on behalf of many: it costs nothing, and needs no `close` of its own. Closing one of the
        clients closes the connection of all.
        """
        other = copy(self)
        other._connection = self._connection.with_token(token)
        return other

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.address!r})"


class Annotation(str):
    """The source of an annotation, which a signature shows without quotes."""

    __slots__ = ()
    __repr__ = str.__str__


def documented(method: Function, describe: Function, returns: str, without: Collection[str] = ()) -> None:
    """Give a method the name, documentation and parameters of the function that describes its call, but some.

    Annotations are shown as the source has them: numpy's ArrayLike alone fills five lines otherwise.
    """
    parameters = [each for each in _parameters(describe) if each.name not in without]
    method.__name__ = method.__qualname__ = describe.__name__
    method.__doc__ = _undocumented(describe.__doc__, without)
    method.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
        parameters, return_annotation=Annotation(returns)
    )


@cache  # both clients have a method of most
def _parameters(describe: Function) -> list[inspect.Parameter]:
    return [
        inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY),
        *(
            parameter.replace(annotation=Annotation(parameter.annotation.replace("npt.", "")))
            for parameter in inspect.signature(describe).parameters.values()
            if parameter.kind != inspect.Parameter.VAR_POSITIONAL  # takes nothing: see `calls.apply`
        ),
    ]


def _undocumented(documentation: str | None, arguments: Collection[str]) -> str | None:
    """The documentation without the lines about some arguments."""
    if documentation is None or not arguments:
        return documentation
    lines = documentation.splitlines(keepends=True)
    return "".join(line for line in lines if line.lstrip().partition(":")[0] not in arguments)


def described(describe: Callable[P, Description], *arguments: P.args, **options: P.kwargs) -> Description:
    """What the function describes; ValueError for a number that is not allowed in any call."""
    if options:
        given: dict[str, Any] = options
        require_not_negative(**{name: given[name] for name in NOT_NEGATIVE & given.keys()})
    return describe(*arguments, **options)


def answer_of(describe: Function) -> str:
    """The source of the answer's type: that of a description is `Call[answer]`, or `Pages[answer]`."""
    annotation: str = describe.__annotations__["return"]
    return annotation.partition("[")[2].removesuffix("]")


def opening(
    kind: Callable[[AnyConnection, Description], Stream], describe: Callable[P, Description]
) -> Callable[Concatenate[Client[AnyConnection], P], Stream]:
    """The method that opens a stream of the given kind."""

    def method(self: Client[AnyConnection], /, *arguments: P.args, **options: P.kwargs) -> Stream:
        return kind(self._connection, described(describe, *arguments, **options))

    documented(method, describe, kind.__name__)
    return method
