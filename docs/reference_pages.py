"""Makes the pages of errors and of settings when mkdocs builds the site, from their descriptions."""

from collections.abc import Iterator
from datetime import timedelta
from typing import get_args

import mkdocs_gen_files
from pydantic_core import PydanticUndefined

import dynhull_client
from dynhull_client import _errors
from dynhull_server.settings import PREFIX, Settings
from dynhull_surface.described import LARGEST, Setting, described, option_of
from dynhull_surface.reasons import REASONS, Code, Exit, exit_of, http_of, repeat_of
from dynhull_surface.settings import FenceSettings, HullSettings


def errors() -> Iterator[str]:
    yield "# Errors\n"
    yield "A refused request has changed nothing, unless its reason says otherwise. Messages are for people and may"
    yield "change; reasons are for programs. Numbered batches are those of a producer, such as a writer of the SDK.\n"
    yield "| reason | what has happened | class of the SDK | gRPC | HTTP | exit code | may be sent again |"
    yield "| --- | --- | --- | --- | --- | --- | --- |"
    for name, reason in REASONS.items():
        code, error = reason.code.name, reason.error
        ends = exit_of(getattr(dynhull_client, error)).value
        cells = name, reason.meaning, f"`{error}`", code, http_of(name, code), ends, repeat_of(name, code).value
        yield f"| {' | '.join(map(str, cells))} |"
    yield "\n## Without a reason\n"
    yield "What gRPC itself and proxies answer. With all other codes the class is `DynhullError`.\n"
    yield "| gRPC | class of the SDK | HTTP | exit code | may be sent again |\n| --- | --- | --- | --- | --- |"
    for each in Code:
        if each.error != "DynhullError":
            ends = exit_of(getattr(dynhull_client, each.error)).value
            yield f"| {each.name} | `{each.error}` | {each.http} | {ends} | {each.repeat.value} |"
    yield "\n## Exit codes of commands\n\n| code | meaning |\n| --- | --- |"
    for exit_code in Exit:
        yield f"| {exit_code.value} | {exit_code.meaning} |"
    yield ""


def settings() -> Iterator[str]:
    yield "# Settings\n"
    yield "## Of hulls\n"
    yield "`dynhull create`, `create_hull` and `POST /hulls` take them; they are fixed from then on. The rules of a"
    yield "quarantine have [a page of their own](../outliers.md#hold-out-positions-that-are-wrong).\n"
    yield from described_settings(HullSettings)
    yield "\n## Of fences\n"
    yield "`dynhull fences create` and `replace`, `create_fence` and `replace_fence`, `POST /fences` and"
    yield "`PUT /fences/{name}` take them. What they mean, with areas and subjects, is on [the page about"
    yield "fences](../fences.md).\n"
    yield from described_settings(FenceSettings)
    yield "\n## Of the server\n"
    yield "Each is an option of `dynhull serve`, a variable of the environment, and a line of the file that `--config`"
    yield "names: `--max-points 1000`, `DYNHULL_MAX_POINTS=1000`, `max_points = 1000`. Options come before variables,"
    yield "these before the file. `dynhull config` prints the values and where each is from.\n"
    yield "| option | variable | usual | meaning |\n| --- | --- | --- | --- |"
    for name, field in Settings.model_fields.items():
        usual = "" if field.default in (None, False, PydanticUndefined) else f"`{field.default}`"
        yield f"| `{option_of(name)}` | `{PREFIX}{name.upper()}` | {usual} | {in_cell(field.description or '')} |"
    yield ""


def described_settings(kind: type) -> Iterator[str]:
    yield "| SDK and HTTP | command line | values | meaning |\n| --- | --- | --- | --- |"
    for setting in described(kind):
        yield f"| `{setting.name}` | `{setting.option}` | {values(setting)} | {in_cell(meaning(setting))} |"


def values(setting: Setting) -> str:
    """What a setting takes, the usual value first."""
    if setting.choices:
        others = [each for each in setting.choices if each != setting.usual]
        return ", ".join(f"`{each}`" for each in [setting.usual, *others] if each is not None)
    if setting.kind is bool:
        return "`false`, `true`"
    if setting.kind is timedelta:
        return "a time: `90s`, `30m`; seconds or a `timedelta` in the SDK"
    if get_args(setting.kind):
        return "longitude, latitude"
    greatest = f" to {setting.greatest}" if setting.greatest < LARGEST else ""
    least = f" from {setting.least}" if setting.least is not None else ""
    usual = f"`{setting.usual}`; " if setting.usual is not None else ""
    return f"{usual}{'an integer' if setting.kind is int else 'a number'}{least}{greatest}"


def meaning(setting: Setting) -> str:
    needed = " or ".join(f"`{each}`" for each in setting.needs)
    at_creation = " Said at creation only." if setting.at_creation else ""
    return setting.meaning + (f" Only with {needed}." if needed else "") + at_creation


def in_cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def error_classes() -> Iterator[str]:
    yield "# Classes of errors\n"
    for name in _errors.__all__:
        yield f"::: dynhull_client.{name}\n    options:\n      show_root_heading: true\n      heading_level: 2"
        yield "      force_inspection: true\n"


for page, lines in (("errors", errors()), ("sdk/errors", error_classes()), ("settings", settings())):
    with mkdocs_gen_files.open(f"reference/{page}.md", "w") as file:
        file.write("\n".join(lines))
