"""A hook of mkdocs: the copy button of a block of doctests copies their program, without prompts and answers."""

import re
from doctest import DocTestParser, Example
from html import escape, unescape
from typing import Any

BLOCK = re.compile(r'<div class="([^"]*\bhighlight)">(<pre>.*?</pre>)', re.DOTALL)
PROMPTED = re.compile(r"^```python\n(?=>>> )", re.MULTILINE)
MARKUP = re.compile(r"<[^>]+>")


def on_page_markdown(markdown: str, **_: Any) -> str:
    """Have prompts and answers coloured as such."""
    return PROMPTED.sub("```pycon\n", markdown)


def on_page_content(html: str, **_: Any) -> str:
    return BLOCK.sub(_with_program, html)


def _with_program(block: re.Match[str]) -> str:
    examples = DocTestParser().get_examples(unescape(MARKUP.sub("", block[2])))
    if not examples:
        return block[0]
    program = "".join(map(_pasted, examples))
    return f'<div class="{block[1]}" data-copy="{escape(program)}">{block[2]}'


def _pasted(example: Example) -> str:
    """A statement as the prompt of Python takes it: an empty line ends one of several indented lines."""
    indented = example.source.rstrip("\n").rpartition("\n")[2].startswith(" ")
    return example.source + "\n" * indented
