"""The bibliography names every source that code and pages cite."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
BIBLIOGRAPHY = ROOT / "docs" / "algorithms" / "bibliography.md"
PLACES = (
    "dynhull/**/*.py",
    "dynhull/**/*.hpp",
    "server/**/*.py",
    "clients/**/*.py",
    "clients/*/src/**/*.js",
    "docs/**/*.md",
)
MONTHS = {"March", "July"}  # of the days that the demo replays

NAME = r"(?:van den |van |de )?[A-Z][\w-]+"
CITATION = re.compile(rf"({NAME})(?:(?:,? and |, ){NAME})*,?(?: [\"“][^\"”]+[\"”],?)? \(?((?:19|20)\d\d)\b")


def citations(text: str) -> set[tuple[str, str]]:
    """First authors and years."""
    found = set(CITATION.findall(re.sub(r"\s*\n\s*(?:#|//|\*)?\s*", " ", text)))
    return {(author, year) for author, year in found if author not in MONTHS}


def entries() -> set[tuple[str, str]]:
    keys = re.findall(r"^\* \*\*(.+?) (\d{4})\*\*", BIBLIOGRAPHY.read_text(), re.MULTILINE)
    return {(re.split(r", | and ", authors)[0], year) for authors, year in keys}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("by gift wrapping (Jarvis 1973)", {("Jarvis", "1973")}),
        ('Gilbert, Johnson, Keerthi, "A fast procedure for\n    computing" (1988); other', {("Gilbert", "1988")}),
        ("(Shamos 1978; Houle and Toussaint 1988)", {("Shamos", "1978"), ("Houle", "1988")}),
        ("# EPA (van den Bergen\n# 2001)", {("van den Bergen", "2001")}),
        ("on 8 March 2013, since 1970", set()),
    ],
)
def test_citations_are_recognised(text, expected):
    assert citations(text) == expected


def test_the_bibliography_has_the_cited_sources_and_no_others():
    pages = [path for place in PLACES for path in ROOT.glob(place) if path != BIBLIOGRAPHY]
    assert entries() == {source for path in pages for source in citations(path.read_text())}
