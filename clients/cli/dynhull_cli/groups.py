"""Commands that consist of other commands."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

Function = Callable[..., None]


@dataclass(frozen=True)
class Group:
    """A command that only groups others. Its module documents it with a function of its name.

    Attributes:
        text: the help.
        commands: the commands, by name.
    """

    text: str
    commands: Mapping[str, "Function | Group"]


def group(**commands: "Function | Group") -> Callable[[Function], Group]:
    """Make a group of a function without parameters, of which only the docstring counts."""

    def grouped(documented: Function) -> Group:
        return Group(documented.__doc__ or "", commands)

    return grouped


def beside(commands: Mapping[str, Function | Group]) -> Callable[[Function], Function]:
    """Give a command further ones: those of which the name is its first argument."""

    def with_others(function: Function) -> Function:
        function.beside = commands  # type: ignore[attr-defined]
        return function

    return with_others
