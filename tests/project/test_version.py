"""One version: what `pyproject.toml` says is what is installed, cited, locked, released and told in CHANGELOG.md."""

import re
import tomllib
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).parents[2]
CHANGELOG = (ROOT / "CHANGELOG.md").read_text()
VERSION = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
# The newest release comes first, below what is not released yet.
RELEASES = re.findall(r"^## (\S+)(?: - (\d{4}-\d\d-\d\d))?$", CHANGELOG, re.MULTILINE)


def test_what_is_installed_is_this_version() -> None:
    assert version("dynhull") == VERSION, "this environment is of another version: make .venv/.test"


def test_the_changelog_begins_with_what_is_not_released_and_then_this_version() -> None:
    (unreleased, undated), (newest, _), *_ = RELEASES
    assert (unreleased, undated) == ("Unreleased", "")
    assert newest == VERSION


def test_releases_have_dates_and_the_newest_comes_first() -> None:
    dates = [date for _, date in RELEASES[1:]]
    assert all(dates)
    assert dates == sorted(dates, reverse=True)


def test_each_version_is_told_for_users_in_200_lines_at_most() -> None:
    for section in CHANGELOG.split("\n## ")[1:]:
        lines = section.splitlines()
        assert len(lines) <= 200, f"{lines[0]}: shorten it; or a merge has brought back lines that were replaced"


def test_the_citation_names_this_version_and_its_date() -> None:
    citation = dict(re.findall(r"^([a-z-]+): \"?([^\"\n]+)\"?$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE))
    assert (citation["version"], citation["date-released"]) == RELEASES[1]


def test_the_lock_file_has_this_version() -> None:
    packages = tomllib.loads((ROOT / "uv.lock").read_text())["package"]
    assert [package["version"] for package in packages if package["name"] == "dynhull"] == [VERSION]


def test_the_page_about_releasing_tags_this_version() -> None:
    assert set(re.findall(r"v(\d+\.\d+\.\d+)", (ROOT / "RELEASING.md").read_text())) == {VERSION}


def test_images_of_dynhull_are_built_here_and_not_named_by_another_version() -> None:
    for file in (ROOT / "deploy").rglob("*.yaml"):
        for tag in re.findall(r"image: dynhull[a-z-]*:(\S+)", file.read_text()):
            assert tag in {"latest", VERSION}, file
