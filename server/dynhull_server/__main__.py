"""`python -m dynhull_server`, the same as `dynhull serve`."""

import typer

from .serve import serve

typer.run(serve)
