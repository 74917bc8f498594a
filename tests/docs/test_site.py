"""Links and markup of the pages work on a code host and in the built site."""

import inspect
import pkgutil
import re
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from blocks import blocks

from dynhull_server.settings import Settings
from dynhull_surface.described import described, option_of
from dynhull_surface.settings import FenceSettings, HullSettings

ROOT = Path(__file__).parents[2]
REFERENCE = ROOT / "docs/reference"  # partly generated: the build fails on links that lead nowhere
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "deploy").rglob("*.md"), *(ROOT / "docs").rglob("*.md")])
CODE = re.compile(r"```.*?```|`[^`\n]*`", re.DOTALL)
TARGET = re.compile(r"\]\(([^)\s]+)[^)]*\)")


class Addresses(HTMLParser):
    """What a page shows and links to."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, _: str, attributes: list[tuple[str, str | None]]) -> None:
        self.found += [value for name, value in attributes if name in ("href", "src") and value]


def paths(addresses: list[str]) -> Iterator[str]:
    """The paths of those addresses that are of this project."""
    for address in addresses:
        parts = urlsplit(address)
        if not parts.scheme and not parts.netloc and parts.path:
            yield unquote(parts.path)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_hold_beside_the_files(page: Path) -> None:
    text = CODE.sub("", page.read_text())
    assert "<img" not in text, "an <img> is not rewritten for the site: use ![text](path)"
    targets = [(page.parent / path).resolve() for path in paths(TARGET.findall(text))]
    left = [target for target in targets if not target.is_relative_to(REFERENCE)]
    assert [str(target) for target in left if not target.exists()] == []


@pytest.mark.parametrize("page", [page for page in PAGES if "docs" in page.parts], ids=lambda page: page.name)
def test_the_text_of_a_link_is_not_the_name_of_a_page(page: Path) -> None:
    assert re.findall(r"\[[\w/-]+\.md\]\(", page.read_text()) == []


def test_links_hold_in_the_site(site: Path) -> None:
    broken = []
    for page in site.rglob("*.html"):
        if page.name == "404.html":  # its links are absolute
            continue
        addresses = Addresses()
        addresses.feed(page.read_text())
        targets = [(page.parent / path).resolve() for path in paths(addresses.found)]
        broken += [f"{page.relative_to(site)}: {target}" for target in targets if not target.exists()]
    assert broken == []


def test_pictures_are_described(site: Path) -> None:
    undescribed = re.compile(r'<img alt="(?:No description[^"]*)?"')
    assert [page.parent.name for page in site.rglob("index.html") if undescribed.search(page.read_text())] == []
    assert '<img alt="&lt;DynamicHull of 10 points' in (site / "notebooks/frames/index.html").read_text()


def test_the_site_needs_no_other_host(site: Path) -> None:
    loaded = re.compile(r'(?:<script[^>]*\bsrc|<link[^>]*\brel="stylesheet"[^>]*\bhref)="https?:[^"]*"')
    assert [found for page in site.rglob("*.html") for found in loaded.findall(page.read_text())] == []


def test_every_page_is_in_the_navigation(site: Path) -> None:
    """The build fails on a page that is left out; here, that the front page's menu has them all."""
    addresses = Addresses()
    addresses.feed((site / "index.html").read_text())
    listed = {(site / path).resolve() for path in paths(addresses.found)}
    pages = {page.parent.resolve() for page in site.rglob("index.html")}
    assert pages - listed == set()


def test_lists_and_tables_are_rendered(site: Path) -> None:
    """Markdown for sites wants blocks inside of a list item to be indented by four spaces; code hosts accept two."""
    raw = re.compile(r"^(?:<p>)?(?:[*-] |\d+\. |\|).*", re.MULTILINE)
    code = re.compile(r"<(pre|script|style)\b.*?</\1>", re.DOTALL)
    left = {page.parent.name: raw.findall(code.sub("", page.read_text())) for page in site.rglob("index.html")}
    assert {page: lines for page, lines in left.items() if lines} == {}


def described_by_itself(exported: object) -> bool:
    """Classes and functions are; the names of types, and versions, are not."""
    return inspect.isclass(exported) or inspect.isroutine(exported)


def test_the_reference_has_every_exported_class_and_function(site: Path) -> None:
    shown: set[str] = set()
    directives = {"dynhull", "dynhull_client"}
    for folder in ("library", "sdk"):
        for page in (site / "reference" / folder).rglob("index.html"):
            shown |= set(re.findall(r'id="([\w.]+)"', page.read_text()))
        for source in (REFERENCE / folder).glob("*.md"):
            directives |= set(re.findall(r"^::: ([\w.]+)$", source.read_text(), re.MULTILINE))
    missing = []
    for module in directives:
        public = pkgutil.resolve_name(module)
        exported = [name for name in getattr(public, "__all__", []) if described_by_itself(getattr(public, name))]
        missing += [f"{module}.{name}" for name in exported if f"{module}.{name}" not in shown]
    assert missing == []


def test_attributes_in_the_reference_have_types(site: Path) -> None:
    untyped = re.compile(r'<span title="([\w.]+)">\w+</span></code></td>\s*<td>\s*</td>')
    assert [
        found for page in (site / "reference").rglob("index.html") for found in untyped.findall(page.read_text())
    ] == []


def test_help_fits_into_the_column(site: Path) -> None:
    widest = [
        max(map(len, block.text.splitlines()))
        for page in (site / "reference/commands").rglob("index.html")
        for block in blocks(page.read_text())
    ]
    assert max(widest) <= 100


def test_settings_are_a_table(site: Path) -> None:
    cells = re.findall(r"<td><code>([^<]*)</code></td>", (site / "reference/settings/index.html").read_text())
    known = {each.name for kind in (HullSettings, FenceSettings) for each in described(kind)}
    assert known | {option_of(name) for name in Settings.model_fields} <= set(cells)


def test_examples_in_the_reference_are_code(site: Path) -> None:
    for page in (site / "reference").rglob("index.html"):
        assert "<blockquote>" not in page.read_text(), page
