"""What users see of every way to the server, word by word: a change of it is a change of these files.

`make surface` writes them anew; the difference belongs into the review, and what users notice into CHANGELOG.md.
"""

import dataclasses
import inspect
import json
import os
import re
from collections.abc import Callable, Iterator
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import dynhull_client
from dynhull_cli.commands import app
from dynhull_gateway.app import application
from dynhull_gateway.settings import Settings
from dynhull_surface.reasons import REASONS, exit_of, http_of, repeat_of

GOLDENS = Path(__file__).parent / "goldens"
LONGEST = 200
FRAMES = re.compile(r"[│╭╮╰╯─]")


def openapi() -> Iterator[str]:
    described = application(None, Settings()).openapi()  # type: ignore[arg-type]  # nothing is called
    del described["info"]["version"]
    yield from _lines(described, "")


def _lines(value: Any, path: str) -> Iterator[str]:
    """A document of JSON as lines, each a path and what fits into a line there."""
    text = json.dumps(value, ensure_ascii=False, sort_keys=True)
    if len(text) <= LONGEST or not isinstance(value, dict | list):
        yield f"{path} {text}"
        return
    named = {each.get("name", i) if isinstance(each, dict) else i: each for i, each in enumerate(value)}
    for name, each in sorted(value.items()) if isinstance(value, dict) else named.items():
        yield from _lines(each, f"{path}.{name}")


def helps() -> Iterator[str]:
    names = [""]
    for entry in sorted(entry_points(group="dynhull.commands")):
        names += _commands(entry.name, entry.load())
    for name in names:
        with_help = [*name.split(), "--help"]
        shown = CliRunner().invoke(app, with_help, prog_name="dynhull", env={"COLUMNS": "160", "TERM": "dumb"})
        yield f"# dynhull {name}".rstrip()
        yield from (line for line in (FRAMES.sub("", each).rstrip() for each in shown.output.splitlines()) if line)


def _commands(name: str, command: Any) -> Iterator[str]:
    yield name
    for parts in (getattr(command, "commands", {}), getattr(command, "beside", {})):
        for part, inner in parts.items():
            yield from _commands(f"{name} {part}", inner)


def sdk() -> Iterator[str]:
    for name in sorted(dynhull_client.__all__):
        each = getattr(dynhull_client, name)
        if not inspect.isclass(each):
            yield f"{name}{_parameters(each) if callable(each) else ''}"
        elif issubclass(each, Exception):
            yield f"{name}({', '.join(base.__name__ for base in each.__bases__)})"
        else:
            yield f"{name}{_parameters(each)}"
            members = inspect.getmembers(each, lambda member: callable(member) or isinstance(member, property))
            for member, value in members:
                if not member.startswith("_"):
                    yield f"    .{member}{_parameters(value) if callable(value) else ''}"


def _parameters(called: Callable[..., Any]) -> str:
    """The names, kinds and defaults: how types are written differs between versions of Python and numpy."""
    try:
        signature = inspect.signature(called)
    except ValueError:
        return "(...)"
    bare = [each.replace(annotation=inspect.Parameter.empty) for each in signature.parameters.values()]
    factory = getattr(dataclasses, "_HAS_DEFAULT_FACTORY", None)
    shown = str(signature.replace(parameters=bare, return_annotation=inspect.Signature.empty))
    return shown.replace(str(factory), "<new>")


def reasons() -> Iterator[str]:
    yield "reason | gRPC | HTTP | exit code | class | may be repeated"
    for name, reason in sorted(REASONS.items()):
        code = reason.code.name
        kind = getattr(dynhull_client, reason.error)
        row = name, code, http_of(name, code), int(exit_of(kind)), reason.error, repeat_of(name, code).value
        yield " | ".join(map(str, row))


@pytest.mark.parametrize(
    ("name", "made"), [("openapi.txt", openapi), ("help.txt", helps), ("sdk.txt", sdk), ("reasons.txt", reasons)]
)
def test_what_users_see_is_what_was_agreed(name: str, made: Callable[[], Iterator[str]]) -> None:
    text = "\n".join(made()) + "\n"
    golden = GOLDENS / name
    if os.environ.get("SURFACE") == "renew":
        golden.write_text(text)
    assert text == golden.read_text(), "if users shall see this change: make surface"
