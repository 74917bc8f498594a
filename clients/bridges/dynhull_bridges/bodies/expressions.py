"""The expressions of templates: a part of Jinja's, as functions of the values of an event.

Jinja parses them, and only what is below is taken. Values are those of JSON: no attribute of an object of Python is
reached, nothing of Python is called, and nothing grows but by what is written in the template.
"""

import json
import math
import operator
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from difflib import get_close_matches
from typing import Any

from jinja2 import nodes

from .fields import LISTS, OF_EVENT

Values = Mapping[str, Any]
Evaluate = Callable[[Values], Any]
COMPARED: dict[str, Callable[[Any, Any], bool]] = {
    "eq": operator.eq,
    "ne": operator.ne,
    "lt": operator.lt,
    "lteq": operator.le,
    "gt": operator.gt,
    "gteq": operator.ge,
    "in": lambda value, within: value in within,
    "notin": lambda value, within: value not in within,
}
CALCULATED: dict[type[nodes.Expr], Callable[[float, float], float]] = {
    nodes.Add: operator.add,
    nodes.Sub: operator.sub,
    nodes.Mul: operator.mul,
    nodes.Div: operator.truediv,
}
MOST_DIGITS = 17
DEEPEST = 100  # how deep expressions and conditions may be nested


class MistakeError(Exception):
    """What is wrong with a template, and in which line."""

    def __init__(self, line: int, message: str) -> None:
        super().__init__(message)
        self.line = line


class Json(str):
    """Text that is JSON already."""

    __slots__ = ()


def shown(value: Any) -> str:
    """A value within text: nothing for none, numbers without a fraction as whole numbers, lists as JSON."""
    if value is None:
        return ""
    if isinstance(value, float) and value.is_integer() and abs(value) < 2**53:
        return str(int(value))
    return value if isinstance(value, str) else json_text(value)


def json_text(value: Any) -> str:
    """A value as JSON."""
    return value if isinstance(value, Json) else json.dumps(value, ensure_ascii=False)


class Expressions:
    """Compiles expressions.

    Args:
        names: the fields that there are.
    """

    def __init__(self, names: list[str]) -> None:
        self._names = names
        self._depth = 0

    @contextmanager
    def deeper(self, node: nodes.Node) -> Iterator[None]:
        """Count what is nested; MistakeError if it is too deep."""
        if self._depth == DEEPEST:
            raise MistakeError(node.lineno, f"nested more than {DEEPEST} times")
        self._depth += 1
        yield
        self._depth -= 1

    def compiled(self, node: nodes.Node) -> Evaluate:
        """What evaluates an expression; MistakeError if it is none of those that are taken, or names no field."""
        with self.deeper(node):
            return self._compiled(node)

    def _compiled(self, node: nodes.Node) -> Evaluate:
        match node:
            case nodes.Const(value=value):
                if isinstance(value, float) and not math.isfinite(value):
                    raise MistakeError(node.lineno, "a number is too large")
                return lambda _: value
            case nodes.Name(name=name):
                return self._name(node, name)
            case nodes.Getattr(node=inner, attr=attr) | nodes.Getitem(node=inner, arg=nodes.Const(value=attr)):
                return self._member(node, inner, attr)
            case nodes.Filter(node=nodes.Expr() as inner, name=name):
                return self._filtered(node, self.compiled(inner), name)
            case nodes.Test(node=inner, name="none"):
                value = self.compiled(inner)
                return lambda values: value(values) is None
            case nodes.Compare(expr=inner, ops=operands):
                return self._compared(inner, operands)
            case nodes.And(left=left, right=right):
                first, second = self.compiled(left), self.compiled(right)
                return lambda values: first(values) and second(values)
            case nodes.Or(left=left, right=right):
                first, second = self.compiled(left), self.compiled(right)
                return lambda values: first(values) or second(values)
            case nodes.Not(node=inner):
                value = self.compiled(inner)
                return lambda values: not value(values)
            case nodes.Neg(node=inner):
                value = self.compiled(inner)
                return lambda values: _calculated(operator.sub, 0, value(values))
            case nodes.CondExpr(test=test, expr1=then, expr2=nodes.Expr() as otherwise):
                holds, yes, no = self.compiled(test), self.compiled(then), self.compiled(otherwise)
                return lambda values: yes(values) if holds(values) else no(values)
            case nodes.BinExpr(left=left, right=right) if type(node) in CALCULATED:
                calculate, first, second = CALCULATED[type(node)], self.compiled(left), self.compiled(right)
                return lambda values: _calculated(calculate, first(values), second(values))
        raise MistakeError(node.lineno, f"templates have no {type(node).__name__}")

    def _name(self, node: nodes.Node, name: str) -> Evaluate:
        self._check(node, name, self._names, "field")
        return lambda values: values[name]

    def _member(self, node: nodes.Node, inner: nodes.Node, name: Any) -> Evaluate:
        if isinstance(inner, nodes.Name) and inner.name == "event":
            self._check(node, name, OF_EVENT, "field of event")
        elif isinstance(inner, nodes.Name) and inner.name in self._names:
            if inner.name not in LISTS:
                raise MistakeError(node.lineno, f"{inner.name} is a single value: it has no {name!r}")
            if not isinstance(name, int):
                raise MistakeError(node.lineno, f"{inner.name} is a list: {inner.name}[0] is its first value")
        if isinstance(inner, nodes.Getattr) and inner.attr == "data":
            self._check(node, name, self._names, "field")
        value = self.compiled(inner)

        def member(values: Values) -> Any:
            found = value(values)
            if isinstance(found, dict):
                return found.get(name)
            is_place = isinstance(found, list) and isinstance(name, int) and -len(found) <= name < len(found)
            return found[name] if is_place else None

        return member

    def _compared(self, inner: nodes.Node, operands: list[nodes.Operand]) -> Evaluate:
        first = self.compiled(inner)
        rest = [(COMPARED[each.op], self.compiled(each.expr)) for each in operands]

        def compared(values: Values) -> bool:
            left = first(values)
            for compare, other in rest:
                right = other(values)
                try:
                    if not compare(left, right):
                        return False
                except TypeError:  # text and a number, or nothing
                    return False
                left = right
            return True

        return compared

    def _filtered(self, node: nodes.Filter, value: Evaluate, name: str) -> Evaluate:
        if name not in FILTERS:
            raise MistakeError(node.lineno, f"there is no filter {name!r}: there are {', '.join(FILTERS)}")
        make, most, kind = FILTERS[name]
        given = [each.value for each in node.args if isinstance(each, nodes.Const)]
        if len(given) < len(node.args) or len(given) > most or node.kwargs or node.dyn_args or node.dyn_kwargs:
            raise MistakeError(node.lineno, f"the filter {name!r} takes {most or 'no'} constant as an argument")
        if wrong := [each for each in given if not isinstance(each, kind)]:
            raise MistakeError(node.lineno, f"the filter {name!r} takes no {wrong[0]!r}")
        return make(value, *given)

    def _check(self, node: nodes.Node, name: Any, known: Any, what: str) -> None:
        if name not in known:
            near = get_close_matches(str(name), known, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"there are {', '.join(sorted(known))}"
            raise MistakeError(node.lineno, f"there is no {what} {name!r}: {hint}")


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _calculated(calculate: Callable[[float, float], float], left: Any, right: Any) -> float | None:
    """The result; None if a side is no number, or the result is none."""
    if not (_is_number(left) and _is_number(right)):
        return None
    try:
        found = calculate(float(left), float(right))
    except (ArithmeticError, ValueError):
        return None
    return found if math.isfinite(found) else None


def _round(value: Evaluate, digits: int = 0) -> Evaluate:
    def rounded(values: Values) -> Any:
        found = value(values)
        return round(float(found), max(-MOST_DIGITS, min(digits, MOST_DIGITS))) if _is_number(found) else None

    return rounded


def _join(value: Evaluate, between: str = ", ") -> Evaluate:
    def joined(values: Values) -> Any:
        found = value(values)
        return between.join(map(shown, found)) if isinstance(found, list) else found

    return joined


def _length(value: Evaluate) -> Evaluate:
    def length(values: Values) -> Any:
        found = value(values)
        return len(found) if isinstance(found, list | str) else None

    return length


def _default(value: Evaluate, otherwise: Any = "") -> Evaluate:
    def default(values: Values) -> Any:
        found = value(values)
        return otherwise if found is None or found == "" else found

    return default


def _of_text(change: Callable[[str], str]) -> Callable[[Evaluate], Evaluate]:
    return lambda value: lambda values: change(shown(value(values)))


def _slack(text: str) -> str:
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _to_json(value: Evaluate) -> Evaluate:
    return lambda values: Json(json_text(value(values)))


# How each is made, how many arguments it takes, and of which type.
FILTERS: dict[str, tuple[Callable[..., Evaluate], int, Any]] = {
    "default": (_default, 1, str | int | float | None),
    "join": (_join, 1, str),
    "length": (_length, 0, str),
    "lower": (_of_text(str.lower), 0, str),
    "round": (_round, 1, int),
    "slack": (_of_text(_slack), 0, str),
    "tojson": (_to_json, 0, str),
    "upper": (_of_text(str.upper), 0, str),
}
