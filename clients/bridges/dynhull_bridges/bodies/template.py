"""Bodies from a template of the user: the syntax is Jinja's, a template reads the event and nothing else.

It has values, conditions and filters, and neither loops, variables nor calls: it takes time in proportion to its size
and that of the event.
"""

import json
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from time import thread_time
from typing import Any

from jinja2 import Environment, TemplateSyntaxError, nodes

from ..letters import Letter
from ..sources import Kind
from ..target import RefusedError
from .expressions import Expressions, MistakeError, Values, json_text, shown
from .fields import fields_of, samples, values_of

LONGEST_TEMPLATE, LONGEST_BODY = 2**16, 2**20  # characters
MOST_SECONDS = 1.0  # of the processor, for one event
IN_STRINGS = re.compile(r'\\.|"', re.DOTALL)  # of JSON: what is escaped, and where a string begins or ends
JSON_TYPE = "application/json"
MEDIA_TYPE = re.compile(r"[\w.+-]+/[\w.+-]+(;[ -~]+)?", re.ASCII)
Step = Callable[[Values, "Output"], None]


class Output:
    """What a template has made so far.

    Args:
        is_json: whether values are written as JSON: within quotation marks without any of their own.
    """

    def __init__(self, is_json: bool) -> None:
        self._is_json = is_json
        self._within = False  # a string of JSON
        self._pieces: list[str] = []
        self._length = 0

    def literal(self, text: str) -> None:
        """Add text of the template."""
        self._within ^= sum(each == '"' for each in IN_STRINGS.findall(text)) % 2 == 1
        self._add(text)

    def value(self, value: Any) -> None:
        """Add a value."""
        if not self._is_json:
            self._add(shown(value))
        elif self._within:
            self._add(json.dumps(shown(value), ensure_ascii=False)[1:-1])
        else:
            self._add(json_text(value))

    def text(self) -> str:
        """The whole; RefusedError unless it is JSON where it has to be."""
        text = "".join(self._pieces)
        if self._is_json:
            try:
                json.loads(text, parse_constant=_no_constant)
            except (ValueError, RecursionError) as error:
                raise RefusedError(f"the template makes no JSON: {error}") from None
        try:
            text.encode()
        except UnicodeEncodeError:
            raise RefusedError("the template makes half of a character, which UTF-8 does not have") from None
        return text

    def _add(self, text: str) -> None:
        self._length += len(text)
        if self._length > LONGEST_BODY:
            raise RefusedError(f"the template makes more than {LONGEST_BODY} characters")
        self._pieces.append(text)


class Template:
    """Makes bodies from a template.

    Args:
        text: the template.
        place: where it is written, for messages.
        content_type: the media type of what it makes; values are quoted as JSON needs it if that is JSON.
        kinds: the kinds of events that it is for.

    Raises:
        ValueError: it is none, or makes no body of an event that may come: the message has the place, the line and
            what is wrong.
    """

    def __init__(self, text: str, place: str, content_type: str, kinds: Sequence[Kind]) -> None:
        if not MEDIA_TYPE.fullmatch(content_type):
            raise ValueError(f"--content-type {content_type!r} is no media type, such as application/json")
        if len(text) > LONGEST_TEMPLATE:
            raise ValueError(f"{place}: {len(text)} characters; a template has at most {LONGEST_TEMPLATE}")
        self.content_type = content_type
        self._place = place
        self._is_json = content_type.partition(";")[0].rstrip().endswith(("/json", "+json"))
        try:
            parsed = Environment(autoescape=False, keep_trailing_newline=False).parse(text)  # noqa: S701  # not HTML
            self._steps = list(_Steps(fields_of(kinds), self._is_json).of(parsed.body))
        except (TemplateSyntaxError, MistakeError) as error:
            line = error.line if isinstance(error, MistakeError) else error.lineno
            raise ValueError(f"{place}:{line}: {error.args[0] if error.args else error}") from None
        except (RecursionError, OverflowError, ValueError) as error:
            raise ValueError(f"{place}: no template: {error}") from None
        for sample in samples(kinds):
            try:
                self.text(sample)
            except RefusedError as error:
                raise ValueError(f"{place}: of an event of the type {sample.type!r}, {error}") from None

    def text(self, letter: Letter) -> str:
        """The body for an event; RefusedError if it is too long, or no JSON."""
        output = Output(self._is_json)
        values, begun = values_of(letter), thread_time()
        for step in self._steps:
            step(values, output)
            if thread_time() - begun > MOST_SECONDS:
                raise RefusedError(f"the template takes more than {MOST_SECONDS:g} s")
        return output.text()


class _Steps:
    """Compiles a template."""

    def __init__(self, names: list[str], is_json: bool) -> None:
        self._expressions = Expressions(names)
        self._is_json = is_json

    def of(self, body: Sequence[nodes.Node]) -> Iterator[Step]:
        for each in body:
            match each:
                case nodes.Output(nodes=pieces):
                    for piece in pieces:
                        yield self._piece(piece)
                case nodes.If():
                    yield self._condition(each)
                case _:
                    line = min((inner.lineno for inner in each.find_all(nodes.Node) if inner.lineno), default=1)
                    raise MistakeError(
                        each.lineno or line, f"templates have no {type(each).__name__.lower()}, but values and if"
                    )

    def _piece(self, node: nodes.Node) -> Step:
        if isinstance(node, nodes.TemplateData):
            text = node.data
            if self._is_json and (len(text) - len(text.rstrip("\\"))) % 2:
                raise MistakeError(node.lineno + text.count("\n"), "a backslash before a value: double it")
            return lambda _, output: output.literal(text)
        value = self._expressions.compiled(node)
        return lambda values, output: output.value(value(values))

    def _condition(self, node: nodes.If) -> Step:
        with self._expressions.deeper(node):
            branches = [(self._expressions.compiled(it.test), list(self.of(it.body))) for it in (node, *node.elif_)]
            otherwise = list(self.of(node.else_))

        def choose(values: Values, output: Output) -> None:
            steps = next((steps for holds, steps in branches if holds(values)), otherwise)
            for step in steps:
                step(values, output)

        return choose


def _no_constant(name: str) -> Any:
    raise ValueError(f"{name} is no number of JSON")


def read_template(path: Path, content_type: str, kinds: Sequence[Kind]) -> Template:
    """The template in a file; ValueError names it, the line and what is wrong. OSError: it cannot be read."""
    try:
        return Template(path.read_text("utf-8"), str(path), content_type, kinds)
    except UnicodeDecodeError as error:
        raise ValueError(f"{path}: no UTF-8 from byte {error.start} on") from None
