"""Constraints between parameters, and figures derived from them: texts read by a grammar, never executed.

    truth    number < number ...   value == value   value in [constant, ...]   truth and/or truth   not truth
    number   parameter   1.5   + - * / **   ( )   min(...)   max(...)   abs(...)   round(...)

Parameters are written as in the study, dots included. Arithmetic is that of floats, so that no power takes long.
"""

import ast
import math
import operator
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from hevopt.errors import DataError, unknown_name
from hevopt.files.shown import printable, shown

Kind = (
    str  # "number", "text" or "truth": of a parameter's values, and of every part of a constraint
)
Values = Mapping[str, Any]
Part = Callable[[Values], Any]

_CHARACTERS_MAX = 500
_DEPTH_MAX = 40
_ALLOWED = (
    "allowed: parameters, numbers, texts in quotes, + - * / ** ( ), min, max, abs, round, "
    "< <= > >= == !=, in [...], and, or, not"
)
# A text in quotes, or a name with its dots; the e of 1e5 is neither.
_TOKEN = re.compile(
    r"""(?P<text>'[^']*'|"[^"]*")|(?<![\w.])(?P<name>[A-Za-z_]\w*(?:\.\w+)*)""", re.ASCII
)
_WORDS = {"and", "or", "not", "in", "min", "max", "abs", "round"}
_PLACEHOLDER = "_{}_"
_FUNCTIONS: dict[str, Callable[..., float]] = {"min": min, "max": max, "abs": abs, "round": round}
_OF_ONE = {"abs", "round"}
_ARITHMETIC: dict[type[ast.operator], Callable[[float, float], float]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: math.pow,
}
_ORDER: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
}
_EQUALITY: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_MEMBERSHIP: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.In: lambda value, constants: value in constants,
    ast.NotIn: lambda value, constants: value not in constants,
}


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """A condition that a design must meet; `names` are the parameters it speaks of."""

    text: str
    names: frozenset[str]
    part: Part

    def holds(self, values: Values) -> bool:
        """Whether a design meets it; DataError where its arithmetic has no result."""
        return bool(_result(self.text, self.names, self.part, values, "constraint"))


@dataclass(frozen=True, slots=True, eq=False)
class Expression:
    """A number that follows from a design's parameters; `names` are the parameters it speaks of."""

    text: str
    names: frozenset[str]
    part: Part

    def value(self, values: Values) -> int | float:
        """The number, whole where it is one; DataError where the arithmetic has no result."""
        number = float(_result(self.text, self.names, self.part, values, "expression"))
        return int(number) if number.is_integer() else number


def parse(text: str, kinds: Mapping[str, Kind]) -> Constraint:
    """The constraint of a text over parameters of the given kinds; DataError where it is not one."""
    kind, names, part = _parsed(text, kinds, "constraint")
    if kind != "truth" or not names:
        found = f"it is a {kind}" if kind != "truth" else "it names no parameter"
        raise DataError(
            f"{_quoted(text)}: {found}; a comparison of parameters is needed, such as "
            f"{printable(next(iter(kinds)))} <= 5"
        )
    return Constraint(text, names, part)


def expression(text: str, kinds: Mapping[str, Kind]) -> Expression:
    """The number of a text over parameters of the given kinds; DataError where it is not one."""
    kind, names, part = _parsed(text, kinds, "expression")
    if kind != "number":
        raise DataError(f"{_quoted(text, 'expression')}: it is a {kind}; a number is needed")
    return Expression(text, names, part)


def _result(text: str, names: frozenset[str], part: Part, values: Values, what: str) -> Any:
    try:
        return part(values)
    except (ZeroDivisionError, OverflowError, ValueError) as error:
        at = ", ".join(f"{printable(n)} = {shown(values[n])}" for n in sorted(names))
        raise DataError(
            f"{_quoted(text, what)} has no value at {at} ({_reason(error)}); write it so that it "
            "has one for every design"
        ) from None


def _parsed(text: str, kinds: Mapping[str, Kind], what: str) -> tuple[Kind, frozenset[str], Part]:
    """Kind, parameters and function of a text; DataError where the grammar has no such text."""
    if len(text) > _CHARACTERS_MAX:
        raise DataError(
            f"{_quoted(text, what)} has {len(text)} characters; allowed: up to {_CHARACTERS_MAX}; split it"
        )
    tree, names = parsed_tree(text, what)
    if _depth(tree) > _DEPTH_MAX:
        raise DataError(
            f"{_quoted(text, what)} is nested deeper than {_DEPTH_MAX} levels; split it"
        )
    unknown = [name for name in names.values() if name not in kinds]
    if unknown:
        error = unknown_name("parameter", printable(unknown[0]), list(map(printable, kinds)))
        raise DataError(f"{_quoted(text, what)}: {error}")
    try:
        kind, part = _Compiler(names, kinds).part(tree)
    except _Fault as fault:
        raise DataError(f"{_quoted(text, what)}: {fault}") from None
    except (ZeroDivisionError, OverflowError, ValueError) as error:
        raise DataError(f"{_quoted(text, what)} has no value ({_reason(error)})") from None
    return kind, frozenset(names.values()), part


class _Fault(Exception):
    """What is wrong with a part."""


def _quoted(text: str, what: str = "constraint") -> str:
    text = printable(text)
    return f"{what} {text if len(text) <= 80 else text[:77] + '...'!r}"


def _reason(error: Exception) -> str:
    if isinstance(error, ZeroDivisionError):
        return "division by zero"
    return "out of range" if isinstance(error, OverflowError) else "not a real number"


def parsed_tree(text: str, what: str) -> tuple[ast.expr, dict[str, str]]:
    """The syntax tree with a placeholder for each parameter, and placeholder -> parameter."""
    names: dict[str, str] = {}

    def replaced(match: re.Match[str]) -> str:
        name = match["name"]
        if name is None or name in _WORDS:
            return str(match[0])
        known = {known: placeholder for placeholder, known in names.items()}
        placeholder = known.get(name, _PLACEHOLDER.format(len(names)))
        names[placeholder] = name
        return placeholder

    if not text.isprintable() or "\\" in text:
        raise DataError(
            f"{_quoted(text, what)}: printable characters on one line are needed, without \\"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # what Python only warns of, such as `1if`, is a fault
            return ast.parse(_TOKEN.sub(replaced, text).strip(), mode="eval").body, names
    except (SyntaxError, ValueError, Warning, MemoryError, RecursionError):
        hint = "write == for equal; " if re.search(r"(?<![<>=!])=(?!=)", text) else ""
        raise DataError(f"{_quoted(text, what)} cannot be read; {hint}{_ALLOWED}") from None


def _depth(tree: ast.expr) -> int:
    depth = 0
    level: list[ast.AST] = [tree]
    while level and depth <= _DEPTH_MAX:
        depth += 1
        level = [child for node in level for child in ast.iter_child_nodes(node)]
    return depth


class _Compiler:
    """Turns a tree into a function of a design's values, and refuses what the grammar does not have."""

    def __init__(self, names: Mapping[str, str], kinds: Mapping[str, Kind]) -> None:
        self.names, self.kinds = names, kinds

    def part(self, node: ast.expr) -> tuple[Kind, Part]:
        """Kind and function of a part."""
        match node:
            case ast.Constant(value=bool() | None | complex() | bytes()):
                pass
            case ast.Constant(value=str() as value):
                return "text", lambda values: value
            case ast.Constant(value=int() | float() as value):
                number = _finite(float(value))
                return "number", lambda values: number
            case ast.Name(id=placeholder) if placeholder in self.names:
                return self.parameter(self.names[placeholder])
            case ast.BoolOp(op=op, values=parts):
                test = all if isinstance(op, ast.And) else any
                truths = [self.of_kind("truth", part) for part in parts]
                return "truth", lambda values: test(truth(values) for truth in truths)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                truth = self.of_kind("truth", operand)
                return "truth", lambda values: not truth(values)
            case ast.UnaryOp(op=ast.USub() | ast.UAdd() as op, operand=operand):
                inner = self.of_kind("number", operand)
                negative = isinstance(op, ast.USub)
                return "number", (lambda values: -inner(values)) if negative else inner
            case ast.BinOp(op=op) if type(op) in _ARITHMETIC:
                return "number", self.arithmetic(node)
            case ast.Call(func=ast.Name(id=name), keywords=[]) if name in _FUNCTIONS:
                return "number", self.call(name, node.args)
            case ast.Compare():
                return "truth", self.comparison(node)
        raise _Fault(f"{self.written(node)} is not part of a constraint; {_ALLOWED}")

    def of_kind(self, kind: Kind, node: ast.expr) -> Part:
        found, part = self.part(node)
        if found != kind:
            needed = "comparison" if kind == "truth" else kind
            raise _Fault(f"{self.written(node)} is a {found}; a {needed} is needed there")
        return part

    def parameter(self, name: str) -> tuple[Kind, Part]:
        kind = self.kinds[name]
        if kind == "number":
            return kind, lambda values: float(values[name])
        return kind, lambda values: values[name]

    def arithmetic(self, node: ast.BinOp) -> Part:
        operation = _ARITHMETIC[type(node.op)]
        left, right = self.of_kind("number", node.left), self.of_kind("number", node.right)
        if not any(isinstance(inner, ast.Name) for inner in ast.walk(node)):
            constant = _finite(operation(left({}), right({})))
            return lambda values: constant
        return lambda values: _finite(operation(left(values), right(values)))

    def call(self, name: str, arguments: list[ast.expr]) -> Part:
        if (len(arguments) == 1) != (name in _OF_ONE) or not arguments:
            needed = "one argument" if name in _OF_ONE else "two or more arguments"
            raise _Fault(f"{name} takes {needed}, found {len(arguments)}")
        function, parts = _FUNCTIONS[name], [self.of_kind("number", a) for a in arguments]
        return lambda values: function(*(part(values) for part in parts))

    def comparison(self, node: ast.Compare) -> Part:
        kind, left = self.part(node.left)
        steps: list[tuple[Callable[[Any, Any], bool], Part]] = []
        for op, right_node in zip(node.ops, node.comparators, strict=True):
            if type(op) in _MEMBERSHIP and right_node is node.comparators[-1]:
                steps.append((_MEMBERSHIP[type(op)], self.constants(kind, right_node)))
            elif type(op) in _EQUALITY or (type(op) in _ORDER and kind == "number"):
                right = self.of_kind(kind, right_node)
                steps.append(((_EQUALITY | _ORDER)[type(op)], right))
            else:
                raise _Fault(f"{self.written(node)} is not a comparison of {kind}s; {_ALLOWED}")

        def holds(values: Values) -> bool:
            before = left(values)
            for compare, right in steps:
                after = right(values)
                if not compare(before, after):
                    return False
                before = after
            return True

        return holds

    def constants(self, kind: Kind, node: ast.expr) -> Part:
        entries = node.elts if isinstance(node, ast.List | ast.Tuple) else []
        if not entries or any(isinstance(n, ast.Name) for n in ast.walk(node)):
            raise _Fault(f"{self.written(node)}: a list of constants is needed after `in`")
        found = [self.of_kind(kind, entry)({}) for entry in entries]
        return lambda values: found

    def written(self, node: ast.expr) -> str:
        """A part as the user wrote it, blanks apart."""
        text = re.sub(r"_\d+_", lambda m: self.names.get(m[0], m[0]), ast.unparse(node))
        return shown(printable(text))


def _finite(value: float) -> float:
    if math.isfinite(value):
        return value
    raise OverflowError
