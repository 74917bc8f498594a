"""A hook of mkdocs: the pictures of notebooks get their own titles as alternative texts.

nbconvert shows an SVG as an image in base64, with a text that says there is no description.
"""

import base64
import re
from typing import Any

IMAGE = re.compile(r'<img alt="No description[^"]*" src="data:image/svg\+xml;base64,([^"]+)"')
TITLE = re.compile(r"<title>([^<]*)</title>")


def on_page_content(html: str, **_: Any) -> str:
    return IMAGE.sub(_titled, html)


def _titled(image: re.Match[str]) -> str:
    title = TITLE.search(base64.b64decode(image[1]).decode())
    assert title is not None, "a picture in a notebook has no <title>"
    text = title[1].replace('"', "&quot;")
    return f'<img alt="{text}" src="data:image/svg+xml;base64,{image[1]}"'
