"""`python -m dynhull_server`, the same as `dynhull serve`."""

import gc
from importlib.metadata import entry_points

from .garbage import YOUNG

# What is imported stays: to search it for garbage again and again takes an eighth of the start.
gc.set_threshold(YOUNG)

import typer  # noqa: E402

(command,) = entry_points(group="dynhull.commands", name="serve")
typer.run(command.load())
