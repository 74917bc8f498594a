"""Install commands work as they are written, while there is no release on the package index."""

import re
import tomllib
from importlib.metadata import entry_points
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
PAGES = sorted(
    {ROOT / "README.md", ROOT / "CONTRIBUTING.md", *ROOT.glob("deploy/**/*.yaml")}
    | {*ROOT.glob("deploy/*"), *ROOT.glob("docs/**/*.md")}
)
COMMAND = re.compile(r"pip install[^'\"`\n]*['\"]([^'\"\n\[]*)\[([^\]\n]*)\]['\"]")
INSTALL = ROOT / "docs/install.md"
# Extras that an image is built with: by default, and as a page says.
ARGUMENT = re.compile(r"(?:^ARG |--build-arg )EXTRAS=(\S+)", re.MULTILINE)


def commands(page: Path) -> list[tuple[str, str]]:
    """What is installed, and with which extras, in each command of a page."""
    return COMMAND.findall(page.read_text())


@pytest.mark.parametrize("page", [page for page in PAGES if page.is_file()], ids=lambda page: page.name)
def test_pages_install_from_the_source_code(page: Path) -> None:
    if page == INSTALL:
        assert commands(page) == [(".", "server,client"), ("dynhull", "nd")]  # the second one adds to the first
        return
    arguments = ARGUMENT.findall(page.read_text())
    for source, extras in commands(page):
        assert source == "."
        assert set(extras.split(",")) <= set(EXTRAS) or (extras == "$EXTRAS" and arguments)
    for extras in arguments:
        assert set(extras.split(",")) <= set(EXTRAS)


def test_the_page_on_installing_explains_every_extra_for_users() -> None:
    explained = set(re.findall(r"^\| `([a-z-]+)` \|", INSTALL.read_text(), re.MULTILINE))
    wanted = {extra for entry in entry_points(group="dynhull.commands") for extra in entry.extras}
    assert wanted <= explained <= set(EXTRAS)
