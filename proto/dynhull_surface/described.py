"""How what is described once is said: settings, and lists in docstrings."""

import re
from collections.abc import Callable, Mapping
from dataclasses import Field, field, fields
from functools import lru_cache
from textwrap import fill
from types import NoneType
from typing import Any, Literal, NamedTuple, TypeVar, get_args, get_origin

Documented = TypeVar("Documented", bound=Callable[..., Any])

LARGEST = 2**63 - 1  # integer that the server stores


class Flag(NamedTuple):
    """An option of the command line that stands for one value of a choice.

    Attributes:
        option: the option.
        value: what it stands for.
        meaning: what it does.
    """

    option: str
    value: str
    meaning: str


class Setting(NamedTuple):
    """A setting.

    Attributes:
        name: the argument of the SDK and the field of a body.
        kind: its type, without None.
        usual: its value where none is given.
        path: its place on the wire, in the message of the settings.
        meaning: sentences; other settings stand in them as `names`.
        least: the least value; None for any.
        greatest: the greatest value that the contract and the server know.
        needs: settings without one of which it means nothing.
        flag: the option of the command line if it is not named after the setting.
        also: another spelling of the option.
        at_creation: whether it is said when something is created, and not when it is replaced.
        words: what its values are called on the wire where they have other names there.
        of: what it belongs to, if that is no setting.
    """

    name: str
    kind: Any
    usual: Any
    path: str
    meaning: str
    least: int | None = None
    greatest: int = LARGEST
    needs: tuple[str, ...] = ()
    flag: Flag | None = None
    also: str | None = None
    at_creation: bool = False
    words: Mapping[Any, str] = {}
    of: str = ""

    @property
    def choices(self) -> tuple[str, ...]:
        """The values among which to choose; empty if it is no choice."""
        return get_args(self.kind) if get_origin(self.kind) is Literal else ()

    @property
    def option(self) -> str:
        """The option of the command line."""
        return self.flag.option if self.flag else option_of(self.name)


def option_of(name: str) -> str:
    """The option of the command line that is named after a setting."""
    return f"--{name.replace('_', '-')}"


def setting(usual: Any, path: str, meaning: str, **more: Any) -> Any:
    """A described field of a dataclass: its usual value, and the attributes of its `Setting`."""
    return field(default=usual, metadata={"path": path, "meaning": meaning, **more})


@lru_cache
def described(settings: type) -> tuple[Setting, ...]:
    """The described settings of one of the classes, in its order."""
    return tuple(_setting(each) for each in fields(settings) if each.metadata)


def _setting(described: Field[Any]) -> Setting:
    kinds = get_args(described.type)
    kind = next(each for each in kinds if each is not NoneType) if NoneType in kinds else described.type
    return Setting(described.name, kind, described.default, **described.metadata)


def documenting(word: str, meanings: Mapping[str, str]) -> Callable[[Documented], Documented]:
    """Put names and their meanings into a docstring, in place of a line with a word."""

    def document(documented: Documented) -> Documented:
        if documented.__doc__ is not None:  # python -OO leaves them out
            line = re.compile(f"^( *){word}$", re.MULTILINE)
            documented.__doc__ = line.sub(lambda found: _said(meanings, found[1]), documented.__doc__)
        return documented

    return document


def _said(meanings: Mapping[str, str], indent: str) -> str:
    """Names and meanings as lines of a docstring."""
    lines = (f"{name}: {meaning[0].lower()}{meaning[1:].rstrip('.')}." for name, meaning in meanings.items())
    return "\n".join(fill(line, 120, initial_indent=indent, subsequent_indent=f"{indent}    ") for line in lines)
