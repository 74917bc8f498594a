"""The code blocks of a page of the built site, as its copy button gives them."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from html import unescape

BLOCK = re.compile(
    r'<div class="(?:language-(?P<language>\w+) )?highlight"(?: data-copy="(?P<copy>[^"]*)")?>'
    r'(?:<span class="filename">(?P<title>.*?)</span>)?<pre>(?P<code>.*?)</pre>',
    re.DOTALL,
)
MARKUP = re.compile(r"<[^>]+>")


@dataclass(frozen=True, slots=True)
class Block:
    """What the button copies of a block, beside what is shown."""

    language: str
    title: str
    text: str
    shown: str


def blocks(page: str) -> Iterator[Block]:
    for found in BLOCK.finditer(page):
        shown = unescape(MARKUP.sub("", found["code"]))
        copied = shown if found["copy"] is None else unescape(found["copy"])
        yield Block(found["language"] or "", unescape(found["title"] or ""), copied, shown)
