"""Constructs outside the generator's subset are refused with file, line and advice."""

from __future__ import annotations

import importlib.util
import linecache
import sys
from pathlib import Path
from typing import Any

import pytest

from flightstack.firmware.generator.subset import ADVICE, OutsideSubsetError
from flightstack.firmware.generator.unit import Program

HEAD = """
from __future__ import annotations
import math
from typing import Annotated, NamedTuple
import numpy as np
from flightstack.core.compiled import compiled
from flightstack.core.contract import FloatArray, Record, RecordArray, Vector3
from flightstack.core.portable_math import sin_cos

LIMITS = {"a": 1.0}
GAINS = np.array([1.0, 2.0])
Bad = NamedTuple("Bad", [("names", list)])

@compiled
def other(x: float) -> float:
    return x

@compiled
def pair(x: float) -> tuple[float, float]:
    return x, x

@compiled
def fill(a: Annotated[FloatArray, 3]) -> float:
    a[0] = 1.0
    return 2.0

def plain(x: float) -> float:
    return x

@compiled
def rounds(x: float, count: int) -> float:
    for i in range(count):
        x += 1.0
    return x

class Counts(NamedTuple):
    numbers: Annotated[np.ndarray[tuple[int], np.dtype[np.int64]], 2]

class Box(NamedTuple):
    values: Annotated[FloatArray, 3]
    grid: Annotated[FloatArray, 2, 3]
    cube: Annotated[FloatArray, 2, 2, 3]
    x: float

class Part(NamedTuple):
    y: Annotated[FloatArray, 2]

class Kept(NamedTuple):
    part: Part
    z: Annotated[FloatArray, 2]
    count: int
    inner: Annotated[Record, Part]
    parts: Annotated[RecordArray, Part, 2]

@compiled
def law(x: float, n: int, flag: bool, v: Vector3, a: Annotated[FloatArray, 3], box: Box, counts: Counts,
        kept: Annotated[Record, Kept], many: Annotated[RecordArray, Kept]) -> float:
"""
LINE = HEAD.count("\n") + 1
REFUSED = {
    "while x > 0.0:\n    x -= 1.0\nreturn x": "while loop",
    "for value in a:\n    x += value\nreturn x": "for loop over values",
    "m = int(x)\nfor i in range(m):\n    x += 1.0\nreturn x": "loop bound",
    "m = 2 if flag else int(x)\nfor i in range(m):\n    x += 1.0\nreturn x": "loop bound",
    "n = n + 1\nfor i in range(n):\n    x += 1.0\nreturn x": "loop bound",
    "return rounds(x, int(x))": "loop bound",
    "counts.numbers[0] = x\nreturn x": "values of different types",
    "for i in range(3):\n    i = 2\nreturn x": "loop variable",
    "for i in range(3):\n    x += 1.0\nelse:\n    x = 0.0\nreturn x": "else of a loop",
    "try:\n    x = 1.0\nexcept ValueError:\n    x = 2.0\nreturn x": "try statement",
    "raise ValueError": "raise statement",
    "assert x > 0.0\nreturn x": "assert statement",
    "with open('f') as f:\n    return x": "with statement",
    "import math\nreturn x": "import statement",
    "def inner(y: float) -> float:\n    return y\nreturn inner(x)": "function inside a function",
    "f = lambda y: y\nreturn x": "lambda",
    "global LIMITS\nreturn x": "global statement",
    "del x\nreturn 1.0": "delete statement",
    "values = [x, x]\nreturn x": "list",
    "values = {1: x}\nreturn x": "dictionary",
    "values = {x}\nreturn x": "set",
    "return sum([value for value in a])": "function call",
    "y = [value for value in a]\nreturn x": "comprehension",
    "y = 'text'\nreturn x": "string",
    "y = None\nreturn x": "None",
    "return x + 2j": "complex number",
    "both = pair(x)\nreturn x": "tuple",
    "both = (x, x)\nreturn x": "tuple",
    "b = a[0:2]\nreturn x": "slice",
    "return v[0]": "index of a NamedTuple",
    "return kept['missing'][0]": "index of a record",
    "return many[1]['z'][0]": "index of a record",
    "return kept['part']['y'][0]": "index of a NamedTuple",
    "return kept.z[0]": "attribute",
    "return kept['inner'].y[0]": "attribute",
    "return kept['parts'][-1]['y'][0]": "index",
    "return kept['parts'][x]['y'][0]": "index",
    "kept['count'] = x\nreturn x": "values of different types",
    "kept['inner'] = kept['parts'][0]\nreturn x": "array value",
    "part = kept['inner']\npart = kept['parts'][0]\nreturn x": "array value",
    "part = kept['inner'] if flag else kept['parts'][0]\nreturn x": "array value",
    "y, z = kept['inner']\nreturn x": "tuple",
    "part = Part(kept['z'])\nreturn x": "NamedTuple of arrays",
    "return a[x]": "index",
    "return a[-1]": "index",
    "v.x = 1.0\nreturn x": "assignment to an attribute",
    "box.x = 1.0\nreturn x": "assignment to an attribute",
    "box.values = a\nreturn x": "assignment to an attribute",
    "box = Box(box.values, box.grid, box.cube, x)\nreturn x": "NamedTuple of arrays",
    "other_box = box if flag else box\nreturn x": "array value",
    "part = box.cube[1]\nreturn x": "array value",
    "b = box.grid[0, 1:]\nreturn x": "slice",
    "if (y := x) > 0.0:\n    return y\nreturn x": "assignment expression",
    "return other(*a)": "starred expression",
    "return x ** 2": "power",
    "return x % 2.0": "floor division or remainder",
    "return x // 2.0": "floor division or remainder",
    "return float(n & 1)": "bit operation",
    "return a @ a": "matrix product",
    "return 1.0 if flag is True else 0.0": "identity or membership test",
    "if x:\n    return 1.0\nreturn x": "truth of a number",
    "return x + flag": "arithmetic with a bool",
    "return other(1)": "integer for a float",
    "return 1": "integer for a float",
    "return 1.0 if x == flag else 0.0": "values of different types",
    "y = 1\nif flag:\n    y = 1.0\nreturn x": "type of a variable",
    "if flag:\n    y = 1.0\nreturn y": "variable without a value",
    "return x + missing": "name",
    "return LIMITS['a']": "name",
    "return math.sin(x)": "libm function",
    "return math.hypot(x, x)": "libm function",
    "return np.dot(a, a)": "function call",
    "return plain(x)": "function call",
    "return round(x)": "function call",
    "return v._replace(x=1.0).x": "method call",
    "return law(x, n, flag, v, a)": "recursion",
    "return other()": "arguments",
    "return other(x, x)": "arguments",
    "return other(y=x)": "arguments",
    "return v.w": "attribute",
    "return fill(a) + a[0]": "call that writes to an array",
    "if flag:\n    return x": "result",
    "pass": "result",
    "x + 1.0\nreturn x": "statement",
    "return 99999999999 * x": "constant",
    "return 1e39 * x": "constant",
    "b = np.zeros(n)\nreturn x": "array of unknown shape",
    "GAINS[0] = x\nreturn x": "assignment to an attribute",
    "return a + a": "array value",
}


def refused(folder: Path, source: str) -> OutsideSubsetError:
    """Return the refusal of the function ``law`` of a module."""
    path = folder / "a_law.py"
    path.write_text(source)
    spec = importlib.util.spec_from_file_location("a_law", path)
    assert spec is not None
    assert spec.loader is not None
    module: Any = importlib.util.module_from_spec(spec)
    sys.modules["a_law"] = module
    spec.loader.exec_module(module)
    linecache.checkcache(str(path))
    with pytest.raises(OutsideSubsetError) as caught:
        Program().add(module.law)
    return caught.value


@pytest.mark.parametrize(("body", "construct"), REFUSED.items())
def test_construct_outside_the_subset_is_refused(body: str, construct: str, tmp_path: Path) -> None:
    error = refused(tmp_path, HEAD + "".join(f"    {line}\n" for line in body.splitlines()))
    assert error.advice == ADVICE[construct]
    assert LINE - 2 <= error.line <= LINE + body.count("\n")
    assert str(error).startswith(f"a_law.py:{error.line}: ")


@pytest.mark.parametrize(
    ("signature", "construct"),
    {
        "def law(x) -> float:": "annotation",
        "def law(x: float):": "annotation",
        "def law(x: list) -> float:": "annotation",
        "def law(x: Bad) -> float:": "annotation",
        "def law(*x: float) -> float:": "arguments",
        "def law(x: float) -> str:": "annotation",
        "def law(x: Annotated[Record, Kept], n: int) -> Part:\n    return Part(x['y'])\n": "NamedTuple of arrays",
        "def law(x: FloatArray) -> float:\n    return float(x.shape[0])\n": "array of unknown shape",
    }.items(),
)
def test_signature_outside_the_subset_is_refused(signature: str, construct: str, tmp_path: Path) -> None:
    head = HEAD[: HEAD.index("@compiled\ndef law")]
    error = refused(tmp_path, f"{head}@compiled\n{signature}\n    return 1.0\n")
    assert error.advice == ADVICE[construct]


def test_every_advice_is_one_clear_clause() -> None:
    for construct, advice in ADVICE.items():
        assert 8 < len(advice) < 120, construct
        assert not advice.endswith(".")
