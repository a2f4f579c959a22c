"""The linear part of a constraint: half spaces of parameters that every design lies in which meets it."""

import ast
from collections.abc import Iterator, Mapping
from itertools import pairwise

from hevopt.sweeps.plan.constraints import parsed_tree

# Parameter -> factor, and "" -> what is added.
Line = dict[str, float]


def half_spaces(text: str, known: Mapping[str, float]) -> tuple[list[Line], bool]:
    """Lines that are 0 or more for every design that meets a constraint, and whether they are all that it asks.

    known: parameters that are held, and their values. Comparisons by < <= > >= == of sums of parameters times
    constants, joined by `and`, are linear; other parts are left out, and what is strict counts as not strict.
    """
    tree, names = parsed_tree(text, "constraint")
    lines, whole = [], True
    for part in _conjuncts(tree):
        found = None
        if isinstance(part, ast.Compare):
            found = _compared(part, names, known)
        if found is None:
            whole = False
        else:
            lines += found
    return lines, whole


def _conjuncts(node: ast.expr) -> Iterator[ast.expr]:
    if isinstance(node, ast.BoolOp) and isinstance(node.op, ast.And):
        for part in node.values:
            yield from _conjuncts(part)
    else:
        yield node


def _compared(
    node: ast.Compare, names: Mapping[str, str], known: Mapping[str, float]
) -> list[Line] | None:
    sides = [_line(side, names, known) for side in (node.left, *node.comparators)]
    lines = []
    for op, (left, right) in zip(node.ops, pairwise(sides), strict=True):
        if left is None or right is None:
            return None
        match op:
            case ast.Lt() | ast.LtE():
                lines.append(_sum(right, left, -1.0))
            case ast.Gt() | ast.GtE():
                lines.append(_sum(left, right, -1.0))
            case ast.Eq():
                lines += [_sum(left, right, -1.0), _sum(right, left, -1.0)]
            case _:
                return None
    return lines


def _sum(one: Line, other: Line, factor: float) -> Line:
    return {
        key: one.get(key, 0.0) + factor * other.get(key, 0.0) for key in one.keys() | other.keys()
    }


def _constant(line: Line) -> float | None:
    return None if any(value for key, value in line.items() if key) else line.get("", 0.0)


def _line(node: ast.expr, names: Mapping[str, str], known: Mapping[str, float]) -> Line | None:
    """A side as a line; None where it is none."""
    match node:
        case ast.Constant(value=int() | float() as value):
            return {"": float(value)}
        case ast.Name(id=placeholder) if placeholder in names:
            name = names[placeholder]
            return {"": known[name]} if name in known else {name: 1.0}
        case ast.UnaryOp(op=ast.USub(), operand=inner):
            line = _line(inner, names, known)
            return None if line is None else _sum({}, line, -1.0)
        case ast.BinOp(left=first, op=op, right=second):
            left, right = _line(first, names, known), _line(second, names, known)
            return None if left is None or right is None else _joined(left, op, right)
    return None


def _joined(left: Line, op: ast.operator, right: Line) -> Line | None:
    by, factor = _constant(left), _constant(right)
    match op:
        case ast.Add():
            return _sum(left, right, 1.0)
        case ast.Sub():
            return _sum(left, right, -1.0)
        case ast.Mult() if by is not None:
            return _sum({}, right, by)
        case ast.Mult() if factor is not None:
            return _sum({}, left, factor)
        case ast.Div() if factor:
            return _sum({}, left, 1 / factor)
    return None
