"""The description of the gateway as a page for people: one file, without scripts, that asks no other host."""

import json
import re
from collections.abc import Iterator, Mapping
from html import escape
from typing import Any

# Nothing is loaded but what is on the page.
POLICY = "default-src 'none'; style-src 'unsafe-inline'; base-uri 'none'; form-action 'none'"
STYLES = """
:root { color-scheme: light dark; --faint: light-dark(#5c6570, #9aa5b1); --line: light-dark(#d5dae0, #343c46);
  --raised: light-dark(#f3f5f7, #1d232a); }
body { font: 15px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 0 auto; padding: 1rem; overflow-wrap: anywhere; }
details { border: 1px solid var(--line); border-radius: 4px; margin: .4rem 0; padding: .4rem .8rem; }
summary { cursor: pointer; } summary b { display: inline-block; min-width: 4.2rem; }
summary span, dd, small { color: var(--faint); }
code, pre { background: var(--raised); border-radius: 3px; padding: .1rem .3rem; }
pre { padding: .6rem; overflow-x: auto; } dt { margin-top: .4rem; } dd { margin-left: 1.2rem; }
"""


def page_of(description: Mapping[str, Any], root: str) -> str:
    """The page, given an OpenAPI document and the path below which a proxy shows the gateway."""
    title = f"{description['info']['title']} {description['info']['version']}"
    parts = [
        f"<h1>{escape(title)}</h1>",
        _text(description["info"]["description"]),
        f'<p>For programs: <a href="{escape(root)}/openapi.json">openapi.json</a>.</p>',
    ]
    by_tag: dict[str, list[str]] = {}
    for path, operations in description["paths"].items():
        for method, operation in operations.items():
            tag = next(iter(operation.get("tags", ["others"])))
            by_tag.setdefault(tag, []).append(_operation(method, path, operation))
    for tag, found in by_tag.items():
        parts += [f"<h2>{escape(tag.capitalize())}</h2>", *found]
    parts.append("<h2>Objects</h2>")
    parts += [_schema(name, schema) for name, schema in sorted(description["components"]["schemas"].items())]
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f'<meta name="viewport" content="width=device-width, initial-scale=1"><style>{STYLES}</style></head>'
        f"<body>{''.join(parts)}</body></html>\n"
    )


def _operation(method: str, path: str, operation: Mapping[str, Any]) -> str:
    about, _, more = operation.get("description", "").partition("\n\n")
    content = [_text(more)] if more else []
    fields = "".join(
        _field(each["name"], {**each["schema"], **each}, required=each.get("required", False))
        for each in operation.get("parameters", ())
    )
    if fields:
        content.append(f"<p>Parameters:</p><dl>{fields}</dl>")
    for kind, body in operation.get("requestBody", {}).get("content", {}).items():
        content.append(f"<p>Body, <code>{escape(kind)}</code>: {_kind(body.get('schema', {}))}</p>")
        content += [_example(each["value"]) for each in body.get("examples", {}).values() if "value" in each]
        content += [_example(body["example"])] if "example" in body else []
    for status, response in operation["responses"].items():
        kinds = ", ".join(
            f"<code>{escape(kind)}</code> {_kind(body.get('schema', {}))}"
            for kind, body in response.get("content", {}).items()
        )
        content.append(f"<p>{escape(status)}: {escape(response['description'])} {kinds}</p>")
    name = escape(operation["operationId"])
    return (
        f'<details id="{name}"><summary><b>{method.upper()}</b> <code>{escape(path)}</code> '
        f"<span>{_marked(about)}</span></summary>{''.join(content)}</details>"
    )


def _schema(name: str, schema: Mapping[str, Any]) -> str:
    required = schema.get("required", ())
    fields = "".join(
        _field(each, about, required=each in required) for each, about in schema.get("properties", {}).items()
    )
    about = _text(schema.get("description", "")) + (f"<dl>{fields}</dl>" if fields else f"<p>{_kind(schema)}</p>")
    # What a link leads to is within, so that browsers open it.
    return f'<details><summary>{escape(name)}</summary><div id="schema-{escape(name)}">{about}</div></details>'


def _field(name: str, about: Mapping[str, Any], *, required: bool) -> str:
    usual = "" if about.get("default") is None else f", usually <code>{escape(json.dumps(about['default']))}</code>"
    needed = ", required" if required else ""
    return (
        f"<dt><code>{escape(name)}</code> <small>{_kind(about)}{needed}{usual}</small></dt>"
        f"<dd>{_marked(about.get('description', ''))}</dd>"
    )


def _kind(schema: Mapping[str, Any]) -> str:
    """A type in a few words, with links to those that have a name."""
    if "$ref" in schema:
        name = escape(schema["$ref"].rpartition("/")[2])
        return f'<a href="#schema-{name}">{name}</a>'
    for several in ("anyOf", "oneOf", "allOf"):
        if several in schema:
            return " or ".join(dict.fromkeys(map(_kind, schema[several])))
    if "enum" in schema:
        return " or ".join(f"<code>{escape(json.dumps(each))}</code>" for each in schema["enum"])
    if "const" in schema:
        return f"<code>{escape(json.dumps(schema['const']))}</code>"
    if schema.get("type") == "array":
        return f"list of {_kind(schema.get('items', {}))}"
    return escape(str(schema.get("type", "any value")))


def _example(value: Any) -> str:
    return f"<pre>{escape(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False))}</pre>"


def _text(text: str) -> str:
    return "".join(_paragraphs(text))


def _paragraphs(text: str) -> Iterator[str]:
    for paragraph in text.split("\n\n"):
        if paragraph.strip():
            yield f"<p>{_marked(paragraph)}</p>"


def _marked(text: str) -> str:
    """Text with its words between backticks as code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(text))
