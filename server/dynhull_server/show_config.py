"""`dynhull config`: the settings of `dynhull serve`."""

import typer

from .flags import as_toml, with_settings
from .settings import Settings
from .storage.databases import without_password


@with_settings
def config(settings: Settings, origins: dict[str, str]) -> None:
    """Show the settings that `dynhull serve` would use, in the format of --config, and the origin of each."""
    lines = {}
    for name in Settings.model_fields:
        value = getattr(settings, name)
        if name == "journal" and value is not None:
            value = without_password(value)
        lines[name] = f"# {name} =" if value is None else f"{name} = {as_toml(value)}"
    width = max(map(len, lines.values()))
    for name, line in lines.items():
        typer.echo(f"{line:{width}}  # {origins[name]}")
