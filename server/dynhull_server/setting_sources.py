"""Where settings come from: flags, the environment and a file.

Flags take precedence over the environment, and the environment over the file.
"""

import logging
import os
import re
import tomllib
from collections.abc import Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from .settings import PREFIX, RENAMED, Settings

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails


# Kubernetes gives every container DYNHULL_PORT=tcp://ADDRESS:PORT, and more of this form, of a Service named dynhull.
SERVICE_LINK = re.compile(r"(tcp|udp|sctp)://")

log = logging.getLogger(__name__)


class SettingsError(Exception):
    """Invalid settings; the message has one line for each."""


def load(flags: Mapping[str, Any], file: Path | None) -> Settings:
    """The settings from flags, environment and file, or raise SettingsError."""
    _refuse_ignored(flags)
    in_file = with_present_names(read_file(file))
    in_environment = from_environment()
    try:
        return Settings.model_validate(in_file | in_environment | with_present_names(flags))
    except ValidationError as error:
        sources = origins(flags, file)
        lines = [_explained(each, sources, file) for each in error.errors()]
        raise SettingsError("\n".join(lines)) from None


def from_environment() -> dict[str, str]:
    """The settings that the environment has, under present or former names of variables in any case."""
    given = {name.upper(): value for name, value in os.environ.items()}
    renamed = {RENAMED[old]: os.environ[variable] for old, variable in old_variables().items()}
    named = {name: given[each] for name in Settings.model_fields if (each := f"{PREFIX}{name.upper()}") in given}
    ignored = service_links()
    return {name: value for name, value in (renamed | named).items() if name not in ignored}


def origins(flags: Mapping[str, Any], file: Path | None) -> dict[str, str]:
    """The origin of each setting."""
    in_file, flags = with_present_names(read_file(file)), with_present_names(flags)
    variables, ignored = {name.upper() for name in os.environ}, service_links()
    renamed = {RENAMED[old]: variable for old, variable in old_variables().items()}
    origins = {}
    for name in Settings.model_fields:
        variable = f"{PREFIX}{name.upper()}"
        if name in flags:
            origins[name] = "flag"
        elif variable in variables and name not in ignored:
            origins[name] = variable
        elif name in renamed:
            origins[name] = renamed[name]
        else:
            origins[name] = str(file) if name in in_file else "default"
    return origins


def with_present_names(values: Mapping[str, Any]) -> dict[str, Any]:
    """Settings of one source under the names that they have now; SettingsError if one has both of its names."""
    for old, new in RENAMED.items():
        if old in values and new in values:
            raise SettingsError(f"{old} is the former name of {new}: leave it out")
    return {RENAMED.get(name, name): value for name, value in values.items()}


def old_variables() -> dict[str, str]:
    """The variables of the environment with a setting under its former name, by that name."""
    former = {f"{PREFIX}{old.upper()}": old for old in RENAMED}
    return {former[name.upper()]: name for name in os.environ if name.upper() in former}


def old_names(flags: Mapping[str, Any], file: Path | None) -> list[str]:
    """A line for each setting that is given under its former name."""
    given = [(f"--{old.replace('_', '-')}", old) for old in RENAMED if old in flags]
    given += [(variable, old) for old, variable in old_variables().items()]
    given += [(f"{file}: {old}", old) for old in RENAMED if old in read_file(file)]
    return [f"{name} is called --{RENAMED[old].replace('_', '-')} now, and means the same" for name, old in given]


def service_links() -> dict[str, str]:
    """The values that Kubernetes has put in place of settings: links to its Services. They are ignored."""
    given = {name.upper(): value for name, value in os.environ.items()}
    values = {name: given.get(f"{PREFIX}{name.upper()}", "") for name in Settings.model_fields}
    return {name: value for name, value in values.items() if SERVICE_LINK.match(value)}


def warn_of_service_links() -> None:
    """Log what is ignored."""
    for name, value in service_links().items():
        log.warning(
            "%s%s is ignored: its value is a link of Kubernetes to a Service; enableServiceLinks: false leaves it out",
            PREFIX,
            name.upper(),
            extra={"value": value},
        )


def _refuse_ignored(flags: Mapping[str, Any]) -> None:
    for name in ("data", "durability", "journal"):
        if flags.get("in_memory") and name in flags:
            raise SettingsError(f"--in-memory stores nothing, so --{name} has no effect: leave one of them out")
    if "journal" in flags and "data" in flags:
        raise SettingsError("--journal takes the place of the folder, so --data has no effect: leave one of them out")


def _explained(error: "ErrorDetails", origins: Mapping[str, str], file: Path | None) -> str:
    """A line that names the setting as its source does: as a flag, a variable, or a key of the file."""
    if not error["loc"]:
        return str(error["ctx"]["error"])
    name, value, message = str(error["loc"][0]), error["input"], error["msg"]
    if error["type"] == "extra_forbidden":
        close = get_close_matches(name, Settings.model_fields, 1)
        return f"{file}: {name}: there is no such setting" + (f"; did you mean {close[0]}?" if close else "")
    match origins[name]:
        case "flag":
            return f"--{name.replace('_', '-')} {value}: {message}"
        case origin if origin == str(file):
            return f"{file}: {name} = {value!r}: {message}"
        case variable:
            return f"{variable}={value!r}: {message}"


def read_file(file: Path | None) -> dict[str, Any]:
    """The content of a settings file, or raise SettingsError."""
    if file is None:
        return {}
    try:
        return tomllib.loads(file.read_text("utf-8"))
    except OSError as error:
        raise SettingsError(f"--config {file}: {error.strerror}") from None
    except ValueError as error:
        raise SettingsError(f"{file}: {error}") from None
