"""Where settings come from: flags, the environment and a file.

Apart from the settings themselves: help and shell completion need only their names and descriptions, and do without
pydantic-settings.
"""

import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from pydantic_settings import BaseSettings, PydanticBaseSettingsSource, SettingsConfigDict, TomlConfigSettingsSource

from .settings import PREFIX, Settings


class SettingsError(Exception):
    """Invalid settings; the message has one line for each."""


def load(flags: Mapping[str, Any], file: Path | None) -> Settings:
    """The settings from flags, environment and file, or raise SettingsError."""
    read_file(file)

    class Sources(Settings, BaseSettings):
        model_config = SettingsConfigDict(env_prefix=PREFIX, toml_file=file)

        @classmethod
        def settings_customise_sources(
            cls, settings_cls: type[BaseSettings], *sources: Any, **more: Any
        ) -> tuple[PydanticBaseSettingsSource, ...]:
            """Flags take precedence over the environment, and the environment over the file."""
            named = dict(zip(("init_settings", "env_settings"), sources, strict=False)) | more
            return named["init_settings"], named["env_settings"], TomlConfigSettingsSource(settings_cls)

    try:
        return Sources(**flags)
    except ValidationError as error:
        lines = []
        for each in error.errors():
            where = ".".join(map(str, each["loc"]))
            lines.append(f"{where}: {each['msg']}" if where else str(each["ctx"]["error"]))
        raise SettingsError("\n".join(lines)) from None


def origins(flags: Mapping[str, Any], file: Path | None) -> dict[str, str]:
    """The origin of each setting."""
    in_file = read_file(file)
    variables = {name.upper() for name in os.environ}
    origins = {}
    for name in Settings.model_fields:
        variable = f"{PREFIX}{name.upper()}"
        if name in flags:
            origins[name] = "flag"
        elif variable in variables:
            origins[name] = variable
        else:
            origins[name] = str(file) if name in in_file else "default"
    return origins


def read_file(file: Path | None) -> dict[str, Any]:
    """The content of a settings file, or raise SettingsError."""
    if file is None:
        return {}
    try:
        return tomllib.loads(file.read_text("utf-8"))
    except (OSError, ValueError) as error:
        raise SettingsError(f"{file}: {error}") from None
