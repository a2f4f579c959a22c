"""Constraints: their value is that of Python's own arithmetic, and nothing but comparisons gets in."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hevopt.errors import DataError
from hevopt.sweeps.plan.constraints import parse

KINDS = {"a": "number", "b.c": "number", "r.0": "number", "engine": "text", "clutch": "truth"}
VALUES = {"a": 3, "b.c": 0.5, "r.0": 4.0, "engine": "big", "clutch": True}


@pytest.mark.parametrize(
    ("text", "holds"),
    [
        ("a * 2 >= 6", True),
        ("a * 2 > 6", False),
        ("1 < a <= r.0 < 5", True),
        ("1 < a < b.c", False),
        ("a ** 2 + b.c == 9.5", True),
        ("-a < -2 and not b.c > 1", True),
        ("a > 5 or b.c > 5", False),
        ("min(a, r.0, 7) == 3 and max(a, b.c) == 3 and abs(b.c - a) == 2.5", True),
        ("a / 2 - (1 - b.c) == 1e0", True),
        ("a in [1, 3] and a not in (4, 5)", True),
        ("engine == 'big' and engine != \"b.c\"", True),
        ("engine in ['small', 'tiny']", False),
        ("clutch", True),
        ("not clutch or a == 3", True),
        ("a < 0 and 1 / (a - 3) > 1", False),
    ],
)
def test_constraints_by_hand(text, holds):
    assert parse(text, KINDS).holds(VALUES) is holds


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a", "it is a number; a comparison of parameters is needed"),
        ("a + 1", "it is a number"),
        ("1 < 2", "it names no parameter"),
        ("a = 3", "write == for equal"),
        ("", "cannot be read"),
        ("(((", "cannot be read"),
        ("a > 1 if a else 2", "cannot be read"),
        ("a > 1if", "cannot be read"),
        ("aa > 1", "parameter 'aa' not found; close matches: a"),
        ("b.d > 1", "parameter 'b.d' not found; close matches: b.c"),
        ("b . c > 1", "parameter 'b' not found"),
        ("__import__('os').system('true') == 0", "parameter '__import__' not found"),
        ("a.__class__ == 1", "parameter 'a.__class__' not found"),
        ("(a).real > 1", "'a.real' is not part of a constraint"),
        ("a(1) > 1", "'a(1)' is not part of a constraint"),
        ("a[0] > 1", "'a[0]' is not part of a constraint"),
        ("(a := 3) > 1", "is not part of a constraint"),
        ("min(*[a, 2]) > 1", "min takes two or more arguments"),
        ("min(a, *[2]) > 1", "is not part of a constraint"),
        ("max(a) > 1", "max takes two or more arguments"),
        ("abs(a, 1) > 1", "abs takes one argument"),
        ("a // 2 > 1", "is not part of a constraint"),
        ("a % 2 > 1", "is not part of a constraint"),
        ("a < 1j", "is not part of a constraint"),
        ("a < True", "parameter 'True' not found"),
        ("a < ...", "is not part of a constraint"),
        ("f'{a}' == 'x'", "cannot be read"),
        ("a < engine", "'engine' is a text; a number is needed there"),
        ("engine < 'x'", "is not a comparison of texts"),
        ("engine == 3", "'3' is a number; a text is needed there"),
        ("a == 'x'", "is a text; a number is needed there"),
        ("engine + 'x' == 'y'", "is a text; a number is needed there"),
        ("a in 3", "a list of constants is needed after `in`"),
        ("a in []", "a list of constants is needed after `in`"),
        ("a in [b.c]", "a list of constants is needed after `in`"),
        ("a in [1] < 3", "is not a comparison of numbers"),
        ("a > 9 ** 9 ** 9", "has no value (out of range)"),
        ("a > 1e999", "has no value (out of range)"),
        ("a > 1 / 0", "has no value (division by zero)"),
        ("a > (-8) ** 0.5", "has no value (not a real number)"),
        ("a > " + "9" * 400, "out of range"),
        ("a > " + "-" * 60 + "1", "is nested deeper than 40 levels"),
        ("a > " + "(" * 300 + "1" + ")" * 300, "has 605 characters"),
        ("a > " + "(" * 240 + "1" + ")" * 240, "cannot be read"),
        ("a > 1 \n", "printable characters on one line"),
        ("engine == 'a\\n'", "printable characters on one line"),
    ],
)
def test_what_is_no_constraint_is_refused_with_what_is_allowed(text, words):
    with pytest.raises(DataError) as found:
        parse(text, KINDS)
    assert words in str(found.value) and "\n" not in str(found.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("1 / (a - 3) > 1", "division by zero"),
        ("9 ** 9 ** (a * 3) > 1", "out of range"),
        ("1e300 * a * 1e10 > 1", "out of range"),
        ("(0 - a) ** b.c > 1", "not a real number"),
    ],
)
def test_a_design_at_which_a_constraint_has_no_value_is_named(text, reason):
    constraint = parse(text, KINDS)
    with pytest.raises(DataError, match=reason) as found:
        constraint.holds(VALUES)
    assert "a = 3" in str(found.value)


numbers = st.one_of(
    st.sampled_from(["a", "b.c", "r.0"]),
    st.integers(0, 9).map(str),
    st.floats(0, 9).map(lambda x: format(x, ".3f")),
)
sums = st.recursive(
    numbers,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["+", "-", "*"]), inner).map(" ".join),
        inner.map("({})".format),
        inner.map("-{}".format),
        st.tuples(inner, inner).map("min({0[0]}, {0[1]})".format),
        inner.map("abs({})".format),
    ),
    max_leaves=6,
)
order = st.sampled_from(["<", "<=", ">", ">=", "==", "!="])
comparisons = st.tuples(sums, order, sums, order, sums).map(" ".join)
truths = st.recursive(
    comparisons,
    lambda inner: st.one_of(
        st.tuples(inner, st.sampled_from(["and", "or"]), inner).map(
            "({0[0]}) {0[1]} {0[2]}".format
        ),
        inner.map("not {}".format),
    ),
    max_leaves=4,
)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(truths, st.floats(-9, 9), st.integers(-9, 9))
def test_the_value_of_a_constraint_is_that_of_python(text, x, n):
    try:
        constraint = parse(text, KINDS)
    except DataError as refused:
        assert any(words in str(refused) for words in ("names no", "characters", "deeper"))
        return
    values = {**VALUES, "a": n, "b.c": x}
    plain = text.replace("b.c", "bc").replace("r.0", "r0")
    names = {"a": float(n), "bc": x, "r0": 4.0, "min": min, "abs": abs, "__builtins__": {}}
    assert constraint.holds(values) == eval(plain, names)


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.text(alphabet="ab.cr01 ()[]<>=!+-*/'\",andorinotmx:{}\\%@_#~", max_size=30))
def test_any_text_is_a_constraint_or_one_message(text):
    try:
        constraint = parse(text, KINDS)
        assert constraint.holds(VALUES) in (True, False)
    except DataError as error:
        assert "constraint" in str(error)
