"""What a page has one install is enough for what it has one do."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
# What stands in a block of a page, and the extra without which it is refused.
NEEDS = {
    r"\bhistory=|--history\b|\bhistory set\b": "history",
    r"\bdynhull serve\b": "server",
    r"\bdynhull dashboard\b": "dashboard",
    r"\bdynhull gateway\b": "gateway",
    r"\bdynhull relay\b": "relay",
    r"\bdynhull ingest\b": "ingest",
    r"\bdynhull demo\b": "demo",
    r"\bfrom dynhull_client import\b": "client",
}
INSTALLS = re.compile(r"pip install\s+'\.\[([\w,-]+)\]'")
BLOCK = re.compile(r"^ *```.*?^ *```", re.DOTALL | re.MULTILINE)
PAGES = sorted(page for page in (ROOT / "docs").rglob("*.md") if INSTALLS.search(page.read_text()))


def extras(names: list[str]) -> set[str]:
    """These, and those that they bring."""
    found: set[str] = set()
    while names:
        name = names.pop()
        if name not in found:
            found.add(name)
            for each in EXTRAS[name]:
                if brought := re.match(r"dynhull\[(.*)\]", each):
                    names += brought[1].split(",")
    return found


def test_there_are_pages() -> None:
    assert {"operations-room.md", "past.md", "fleets.md"} <= {page.name for page in PAGES}
    assert extras(["demo"]) >= {"history", "server", "gateway", "proto"}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT / "docs")))
def test_what_is_installed_is_enough(page: Path) -> None:
    text = page.read_text()
    installed = extras([name for each in INSTALLS.findall(text) for name in each.split(",")])
    blocks = "\n".join(BLOCK.findall(text))
    missing = {extra for pattern, extra in NEEDS.items() if re.search(pattern, blocks)} - installed
    assert not missing, f"{page.name} needs {missing}"
