"""Random programs of the generator's subset, as text."""

from __future__ import annotations

from hypothesis import strategies as st

HEAD = '''"""Random programs."""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Vector3
from flightstack.core.geometry import cross
from flightstack.core.portable_math import atan2, sin_cos

HALF = 0.5
COUNT = 3
TABLE = (0.25, -1.5, 3.0)


class Pair(NamedTuple):
    """Two numbers and a vector."""

    first: float
    second: float
    v: Vector3


class Box(NamedTuple):
    """Arrays."""

    values: Annotated[FloatArray, 3]
    grid: Annotated[FloatArray, 2, 3]
    scale: float
    counts: Annotated[np.ndarray[tuple[int], np.dtype[np.int64]], 2]


@compiled
def _turned(x: float, y: float) -> tuple[float, float]:
    return y, x - y


@compiled
def _swapped(pair: Pair, scale: float = 2.0) -> Pair:
    return Pair(pair.second * scale, pair.first, pair.v)


@compiled
def _fill(values: Annotated[FloatArray, 3], x: float) -> float:
    for i in range(values.size):
        values[i] += x * i
    return values[2]


@compiled
def _turn(box: Box, x: float) -> None:
    for i in range(box.grid.shape[0]):
        for j in range(i + 1):
            box.grid[i, j] -= x * box.values[j]


@compiled
def _clear(box: Box, start: int, count: int) -> int:
    for i in range(start, start + count):
        box.values[i] = 0.5 * box.values[i]
        box.counts[0] += 1
    return box.counts[0]


@compiled
def _shrink(box: Box, x: float) -> bool:
    box.values[0] *= 0.5
    return box.values[0] > x


@compiled
def _sum(grid: Annotated[FloatArray, 2, 3]) -> float:
    return grid[0, 0] + grid[1, 2]
'''
NAMES = st.sampled_from(["a", "b", "x", "y"])
NUMBERS = st.sampled_from(["0.0", "-0.0", "1.0", "-2.5", "1e-9", "3", "HALF", "math.pi", "TABLE[1]", "1e30"])
_LEAVES = st.one_of(
    NAMES,
    NUMBERS,
    st.sampled_from(
        [
            "v.x",
            "v.z",
            "pair.first",
            "pair.v.y",
            "w[0]",
            "w[2]",
            "float(n)",
            "box.values[1]",
            "box.grid[1, 0]",
            "box.scale",
            "_sum(box.grid)",
        ]
    ),
)


def _numbers(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    def two(form: str) -> st.SearchStrategy[str]:
        return st.tuples(inner, inner).map(lambda pair: form.format(*pair))

    operators = st.sampled_from(
        ["({} + {})", "({} - {})", "{} * ({})", "({}) / float({})", "{} - {} * HALF", "({} + {}) * x"]
    )
    calls = [
        "max({}, {})",
        "min({}, {}, a)",
        "atan2({}, {})",
        "math.copysign({}, max(-9.0, {}))",
        "cross(v, Vector3(1.0, {}, {})).x",
    ]
    choice = st.tuples(inner, conditions(inner), inner).map(lambda parts: "({} if {} else {})".format(*parts))
    one = st.sampled_from(
        ["-({})", "abs({})", "math.sqrt(abs({}))", "math.floor(min(max(float({}), -9.0), 9.0))", "+({})"]
    )
    return st.one_of(
        operators.flatmap(two),
        st.sampled_from(calls).flatmap(lambda form: two(form.replace("{}", "float({})"))),
        choice,
        st.tuples(one, inner).map(lambda pair: pair[0].format(pair[1])),
    )


def conditions(inner: st.SearchStrategy[str]) -> st.SearchStrategy[str]:
    """Return bool expressions."""
    compared = st.tuples(inner, st.sampled_from(["<", "<=", ">", ">=", "==", "!="]), inner).map(" ".join)
    between = st.tuples(inner, inner, inner).map(lambda parts: "{} < {} <= {}".format(*parts))
    plain = st.one_of(
        compared, between, st.sampled_from(["flag", "not flag", "math.isfinite(a)", "math.isnan(b)"])
    )
    both = st.tuples(plain, st.sampled_from(["and", "or"]), plain).map(
        lambda p: f"({p[0]}) {p[1]} not ({p[2]})"
    )
    return st.one_of(plain, both)


EXPRESSIONS = st.recursive(_LEAVES, _numbers, max_leaves=5).map(lambda text: f"float({text})")
CONDITIONS = conditions(_LEAVES)
_SIMPLE = [
    "{name} = {number}",
    "{name} += {number}",
    "{name} *= {number}",
    "a, b = b, {number}",
    "a, y = _turned({number}, b)",
    "v = Vector3(v.y, {number}, v.x)",
    "v = cross(v, Vector3({number}, 1.0, b))",
    "pair = _swapped(pair, {number})",
    "pair = _swapped(Pair(a, {number}, v))",
    "x, y = sin_cos({number})",
    "w[1], w[0] = w[0], {number}",
    "w[2] -= {number}",
    "b = _fill(w, {number})",
    "x, y, a = v",
    "box.values[0], box.grid[1, 2] = box.grid[0, 1], {number}",
    "box.grid[1, 0] *= {number}",
    "y = _fill(box.values, {number})",
    "_turn(box, {number})",
    "box.counts[1] = _clear(box, COUNT - 2, 2)",
    "_clear(box, 0, 1)",
    "a = {number} + float(box.counts[1])",
    "w[0] = _sum(box.grid) - {number}",
    "v = v if flag and a > {number} else cross(v, pair.v)",
    "a = cross(v, pair.v).x if flag else {number}",
    "flag = flag or not cross(v, pair.v).y > {number}",
    "pair = pair if -1.0 < {number} < b else Pair(a, b, cross(pair.v, v))",
]


@st.composite
def statements(draw: st.DrawFn, depth: int = 0, in_loop: bool = False) -> list[str]:
    """Return lines of a block."""
    lines: list[str] = []
    for _ in range(draw(st.integers(2, 5) if depth == 0 else st.integers(1, 3))):
        kind = draw(st.integers(0, 6 if depth < 2 else 3))
        if kind <= 3:
            form = draw(st.sampled_from(_SIMPLE))
            lines.append(form.format(name=draw(NAMES), number=draw(EXPRESSIONS)))
        elif kind == 4:
            block = draw(statements(depth + 1, in_loop))
            if draw(st.booleans()):
                block.append(
                    draw(st.sampled_from(["return pair, a + x", *(["break", "continue"] if in_loop else [])]))
                )
            test = draw(
                st.one_of(CONDITIONS, CONDITIONS, st.sampled_from(["_shrink(box, a)", "not _shrink(box, y)"]))
            )
            lines += [f"if {test}:", *(f"    {line}" for line in block)]
            if draw(st.booleans()):
                lines += ["else:", *(f"    {line}" for line in draw(statements(depth + 1, in_loop)))]
        else:
            bounds = draw(
                st.sampled_from(
                    ["COUNT", "1, 4", "3, 0, -1", "w.size", "3 if flag else 2", "3 if a > b else 1"]
                )
            )
            name = f"i{depth}"
            block = [f"{draw(NAMES)} -= {name} * HALF", *draw(statements(depth + 1, True))]
            lines += [f"for {name} in range({bounds}):", *(f"    {line}" for line in block)]
    return lines


@st.composite
def programs(draw: st.DrawFn) -> list[str]:
    """Return the lines of a function's body."""
    start = ["a, b = x - 1.0, y * 0.5", "w = np.zeros(3)", "w[0], w[1] = x, y"]
    return [*start, *draw(statements()), f"return Pair(a, w[1], v), {draw(EXPRESSIONS)} + b"]


def function(number: int, body: list[str]) -> str:
    """Return a program as a function of a module."""
    signature = "x: float, y: float, v: Vector3, pair: Pair, n: int, flag: bool, box: Box"
    lines = "\n".join(f"    {line}" for line in body)
    return f"\n\n@compiled\ndef law_{number}({signature}) -> tuple[Pair, float]:\n{lines}\n"
