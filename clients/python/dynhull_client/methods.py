"""A client's methods, made of the functions in `calls`."""

import inspect
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, TypeVar, get_args

from .connection import Connection

P = ParamSpec("P")
Description = TypeVar("Description")
Stream = TypeVar("Stream")
Client = TypeVar("Client", bound=Connection)

Function = Callable[..., Any]


def documented(method: Function, describe: Function, returns: object = None) -> None:
    """Give a method the name, the documentation and the parameters of the function that describes its call.

    Without `returns`, it returns what the description promises: `Call[Hull]` is an answer of type Hull.
    """
    described = inspect.signature(describe)
    if returns is None:
        (returns,) = get_args(described.return_annotation)
    this = inspect.Parameter("self", inspect.Parameter.POSITIONAL_ONLY)
    method.__name__ = describe.__name__
    method.__qualname__ = describe.__qualname__
    method.__doc__ = describe.__doc__
    method.__signature__ = described.replace(  # type: ignore[attr-defined]
        parameters=[this, *described.parameters.values()], return_annotation=returns
    )


def opening(
    kind: Callable[[Client, Description], Stream], describe: Callable[P, Description]
) -> Callable[Concatenate[Client, P], Stream]:
    """The method that opens a stream of the given kind."""

    def method(self: Client, /, *arguments: P.args, **options: P.kwargs) -> Stream:
        return kind(self, describe(*arguments, **options))

    documented(method, describe, kind)
    return method
