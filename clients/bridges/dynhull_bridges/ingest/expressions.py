"""Expressions that take a value from a message: paths into its JSON, and texts with places to fill in.

A path is a singular query of JSONPath (RFC 9535): `$`, then names and indices, as in `$.position[0]` or `$['a b'].c`.
A text may have `{1}`, `{2}`, ... for the wildcards of the topic, `{topic}`, `{key}` for the key of a Kafka record, and
`{$.path}`; `{{` and `}}` are braces.
"""

import re
from collections.abc import Callable
from typing import Any

from .feed import Message

STEP = re.compile(
    r"\.([A-Za-z_\u0080-\uffff][\w\u0080-\uffff]*)|\[(-?\d+)\]|\['((?:[^'\\]|\\.)*)'\]|\[\"((?:[^\"\\]|\\.)*)\"\]"
)
FIELD = re.compile(r"(\{\{|\}\}|\{[^{}]*\}|[{}])")
DOUBLED = {"{{": "{", "}}": "}"}
PLACES = "{1}, {2}, ... (wildcards of the topic), {topic}, {key} and {$.path}"
MISSING: Any = object()

Value = Callable[[Message, Any], Any]


def value_of(text: str, option: str) -> Value:
    """The function that an expression stands for: of a message and its JSON document. ValueError names a bad one.

    A path alone returns the value with its type, MISSING where there is none; any other expression returns a string.
    """
    if text.startswith("$"):
        return _at(_steps(text, option))
    parts = FIELD.split(text)
    pieces = [_piece(each, text, option) if index % 2 else each for index, each in enumerate(parts)]
    if all(isinstance(each, str) for each in pieces):
        whole = "".join(map(str, pieces))
        return lambda _message, _document: whole

    def filled(message: Message, document: Any) -> str:
        return "".join(each if isinstance(each, str) else _text(each(message, document), text) for each in pieces)

    return filled


def last_name(text: str) -> str:
    """The last name of a path; empty for any other expression."""
    names = [each for each in _steps(text, "path") if isinstance(each, str)] if text.startswith("$") else []
    return names[-1] if names else ""


def is_fixed(text: str) -> bool:
    """Whether an expression is the same for all messages."""
    return not text.startswith("$") and all(each in DOUBLED for each in FIELD.findall(text))


def is_in_document(text: str) -> bool:
    """Whether an expression takes something from the JSON document."""
    return text.startswith("$") or any(each.startswith("{$") for each in FIELD.findall(text))


def _piece(text: str, whole: str, option: str) -> str | Value:
    """What a brace stands for, with the text up to the one that closes it."""
    if text in DOUBLED:
        return DOUBLED[text]
    if text in "{}":
        raise ValueError(
            f"{option} {whole!r}: {text} has no other brace; {PLACES} are filled in, {{{{ and }}}} stand for braces"
        )
    return _field(text[1:-1], option)


def _field(text: str, option: str) -> Value:
    if text.startswith("$"):
        return _at(_steps(text, option))
    if text == "topic":
        return lambda message, _document: message.topic
    if text == "key":
        return lambda message, _document: MISSING if message.key is None else _decoded(message.key)
    if text.isdecimal() and int(text) >= 1:
        index = int(text) - 1

        def captured(message: Message, _document: Any) -> Any:
            return message.captures[index] if index < len(message.captures) else MISSING

        return captured
    raise ValueError(
        f"{option}: {{{text}}} is not {{topic}}, {{key}}, a path {{$.name}}, or the number of a wildcard from {{1}}; "
        "{{ and }} stand for braces"
    )


def _decoded(key: bytes) -> str:
    try:
        return key.decode()
    except UnicodeDecodeError:
        raise ValueError(f"the key of the record is no text of UTF-8: {key!r}") from None


def _text(value: Any, expression: str) -> str:
    if isinstance(value, str):
        return value
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    raise ValueError(f"{expression!r} cannot be filled in: {'a value is missing' if value is MISSING else repr(value)}")


def _at(steps: list[str | int]) -> Value:
    if len(steps) == 1 and isinstance(steps[0], str):
        name = steps[0]
        return lambda _message, document: document.get(name, MISSING) if isinstance(document, dict) else MISSING

    def found(_message: Message, document: Any) -> Any:
        value = document
        for step in steps:
            if isinstance(step, str):
                value = value.get(step, MISSING) if isinstance(value, dict) else MISSING
            else:
                there = isinstance(value, list) and -len(value) <= step < len(value)
                value = value[step] if there else MISSING
        return value

    return found


def _steps(text: str, option: str) -> list[str | int]:
    steps: list[str | int] = []
    at = 1
    while at < len(text):
        step = STEP.match(text, at)
        if step is None:
            problem = f"{text[at:]!r} at position {at + 1} is no .name, [index] or ['name']"
            raise ValueError(f"{option} {text!r} is no path: {problem}")
        name, index, *quoted = step.groups()
        if index is not None:
            steps.append(int(index))
        else:
            steps.append(
                name if name is not None else re.sub(r"\\(.)", r"\1", next(q for q in quoted if q is not None))
            )
        at = step.end()
    return steps
