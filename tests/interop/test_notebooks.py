"""The notebooks of the documentation: run again, they give the results they show.

After a change, `jupyter execute --inplace docs/notebooks/*.ipynb`, with a server running, stores the new results.
"""

import os
from collections.abc import Iterator
from pathlib import Path

import nbformat
import pytest
from cases import slow

NOTEBOOKS = sorted((Path(__file__).parents[2] / "docs/notebooks").glob("*.ipynb"))
RICHEST_FIRST = ("text/html", "image/svg+xml", "text/plain")


def results(notebook: nbformat.NotebookNode) -> Iterator[str]:
    """What a reader sees below each cell: what is printed, as one text however it was sent, then the value."""
    for cell in notebook.cells:
        outputs = cell.get("outputs", [])
        yield "".join(output.text for output in outputs if output.output_type == "stream")
        for output in outputs:
            if output.output_type != "stream":
                yield next(output.data[kind] for kind in RICHEST_FIRST if kind in output.data)


@slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_it_gives_the_results_it_shows(path: Path, address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from nbclient import NotebookClient  # each worker of the tests imports this file, and one runs it

    monkeypatch.setitem(os.environ, "DYNHULL_ADDRESS", address)
    shown = nbformat.read(path, as_version=4)
    run = nbformat.read(path, as_version=4)
    NotebookClient(run, timeout=60).execute()
    assert list(results(run)) == list(results(shown))
    assert any("<svg" in result for result in results(shown))
