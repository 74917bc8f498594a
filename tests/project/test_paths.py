"""The files and folders that pages for contributors name are there, and CONTRIBUTING.md knows every package."""

import re
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
CONTRIBUTING = ROOT / "CONTRIBUTING.md"
PAGES = [CONTRIBUTING, ROOT / "RELEASING.md", *(ROOT / "docs" / f"{name}.md" for name in ("architecture", "testing"))]
CODE_BLOCK = re.compile(r"^ *```.*?^ *```", re.MULTILINE | re.DOTALL)
PATH = re.compile(r"`([\w-]+(?:[./][\w.-]+)*/?)`")
SUFFIXES = {".py", ".md", ".hpp", ".cpp", ".proto", ".toml", ".yaml", ".svg", ".patch"}


def all_paths() -> list[str]:
    """The files and folders of the repository, each with its path behind a slash."""
    sources = ("proto", "server", "dynhull", "clients", "tests", "docs", "deploy", "benchmarks", ".github")
    below = (path for name in sources for path in (ROOT / name).rglob("*"))
    return [f"/{path.relative_to(ROOT)}" for path in (*ROOT.iterdir(), *below)]


def named(page: Path) -> list[str]:
    """What a page names as a file or folder: by its suffix, or with a slash."""
    words = PATH.findall(CODE_BLOCK.sub("", page.read_text()))
    return [word for word in words if (word.endswith("/") or Path(word).suffix in SUFFIXES) and "COMMIT" not in word]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_what_a_page_names_is_there(page: Path) -> None:
    ends = {"/".join(parts[at:]) for path in all_paths() if (parts := path.split("/")) for at in range(len(parts))}
    found = [word.rstrip("/") for word in named(page) if not word.startswith("build/")]
    assert len(found) > 5
    assert [word for word in found if word not in ends] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_methods_that_a_page_names_are_those_of_their_classes(page: Path) -> None:
    modules = [
        file.read_text() for folder in ("server", "clients", "dynhull") for file in (ROOT / folder).rglob("*.py")
    ]
    for kind, method in re.findall(r"`(?:[a-z]+\.)?([A-Z][a-z]\w*)\.([a-z]\w+)`", page.read_text()):
        homes = [text for text in modules if f"\nclass {kind}" in text]
        assert any(f"def {method}(" in text for text in homes), f"{kind}.{method}"


def test_every_package_is_in_the_table() -> None:
    packages = PROJECT["tool"]["scikit-build"]["wheel"]["packages"]
    table = CONTRIBUTING.read_text()
    generated = {"proto/dynhull_proto"}
    assert [each for each in packages if f"| `{each}/" not in table and each not in generated] == []


def test_the_steps_of_recipes_count_from_one() -> None:
    for paragraph in CONTRIBUTING.read_text().split("\n\n"):
        steps = [int(number) for number in re.findall(r"^(\d+)\. ", paragraph, re.MULTILINE)]
        assert steps == list(range(1, len(steps) + 1)), paragraph
