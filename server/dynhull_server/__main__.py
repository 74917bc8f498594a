"""`python -m dynhull_server`, the same as `dynhull serve`."""

from importlib.metadata import entry_points

import typer

(command,) = entry_points(group="dynhull.commands", name="serve")
typer.run(command.load())
