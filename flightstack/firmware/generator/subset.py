"""The subset of Python that the generator translates, and the advice for everything outside it."""

from __future__ import annotations

import ast
from pathlib import Path


class OutsideSubsetError(Exception):
    """A construct that has no C: file, line, the construct, and what to write instead."""

    def __init__(self, file: str, line: int, construct: str, advice: str) -> None:
        super().__init__(f"{Path(file).name}:{line}: {construct}: {advice}")
        self.file, self.line, self.construct, self.advice = file, line, construct, advice


ADVICE: dict[str, str] = {
    "while loop": "use `for i in range(N)` with a constant N, and `break`",
    "for loop over values": "use `for i in range(N)` and an index",
    "loop bound": "use a constant, the size of an array, another loop's variable, or an integer parameter",
    "loop variable": "copy it to another variable inside the loop",
    "else of a loop": "set a flag in the loop and test it afterwards",
    "try statement": "test the value with `math.isfinite` or a comparison",
    "raise statement": "check parameters in `read_params`; a step must return a value",
    "assert statement": "check parameters in `read_params`; a step must return a value",
    "with statement": "a step has no resources; remove it",
    "import statement": "import at the top of the module",
    "function inside a function": "define it at the top of the module, marked @compiled",
    "lambda": "define a function at the top of the module, marked @compiled",
    "global statement": "keep state in the memory NamedTuple",
    "delete statement": "remove it",
    "list": "use a NamedTuple of floats, or `np.zeros(N)` with a constant N",
    "dictionary": "use a NamedTuple of floats",
    "set": "compare with `==` and `or`",
    "comprehension": "use `for i in range(N)`",
    "string": "use a number",
    "None": "use a number as a flag",
    "complex number": "use two floats",
    "tuple": "unpack it at once: `a, b = f(x)`, or use a NamedTuple",
    "slice": "use `for i in range(N)` and an index",
    "index of a NamedTuple": "use the name of the field",
    "index of a record": 'use the name of a field, `record["x"]`, and `records[0]` for an array of one record',
    "NamedTuple of arrays": "name its fields in their order; the record's NamedTuple must have it as a field",
    "index": "use an integer index",
    "assignment to an attribute": "make a new NamedTuple",
    "assignment expression": "assign in a statement of its own",
    "starred expression": "write the arguments one by one",
    "power": "write `x * x`, or `exp(y * log(x))` of flightstack.core.portable_math",
    "floor division or remainder": "use `math.floor(a / b)`",
    "bit operation": "use arithmetic or bools",
    "matrix product": "use loops over constant sizes, or write the sums",
    "identity or membership test": "compare with `==`",
    "truth of a number": "compare it: `x != 0.0`",
    "arithmetic with a bool": "convert it: `float(flag)` or `int(flag)`",
    "number as a flag": "compare it: `x > 0.0`",
    "integer for a float": "write a decimal point, `1.0`, or convert it: `float(i)`",
    "values of different types": "give both the same type",
    "type of a variable": "use one type for a name in the whole function",
    "variable without a value": "assign it before the `if` or the loop",
    "annotation": "annotate it: float, int, bool, a NamedTuple, tuple[…] or Annotated[FloatArray, N]",
    "array of unknown shape": "annotate it: `Annotated[FloatArray, N]` with the constant size",
    "array value": "use its items, `a[i]`, and write to arrays in place",
    "name": "define it as a constant of the module, or as a @compiled function",
    "libm function": "use flightstack.core.portable_math, whose bits are the same on every processor",
    "function call": "call functions marked @compiled, NamedTuples, min, max, abs, float, int, and functions of math",
    "function without source": "define it in a file",
    "two functions of one name": "rename one: their modules share a prefix in C",
    "recursion": "use a bounded loop",
    "arguments": "pass every argument of the function once",
    "method call": "use a function or an expression",
    "attribute": "use a field of a NamedTuple, or `.size` of an array",
    "call that writes to an array": "give the call a statement of its own, or make it the whole test of an `if`",
    "result": "return a value on every path",
    "statement": "use assignments, `if`, `for … in range(…)`, and `return`",
    "expression": "use arithmetic, comparisons, and calls of @compiled functions",
    "constant": "use a float, an int or a bool that C's types hold",
}
"""Construct → what to write instead."""

STATEMENTS: dict[type[ast.AST], str] = {
    ast.While: "while loop",
    ast.Try: "try statement",
    ast.Raise: "raise statement",
    ast.Assert: "assert statement",
    ast.With: "with statement",
    ast.Import: "import statement",
    ast.ImportFrom: "import statement",
    ast.FunctionDef: "function inside a function",
    ast.AsyncFunctionDef: "function inside a function",
    ast.ClassDef: "function inside a function",
    ast.Global: "global statement",
    ast.Nonlocal: "global statement",
    ast.Delete: "delete statement",
    ast.Lambda: "lambda",
    ast.List: "list",
    ast.Dict: "dictionary",
    ast.Set: "set",
    ast.ListComp: "comprehension",
    ast.SetComp: "comprehension",
    ast.DictComp: "comprehension",
    ast.GeneratorExp: "comprehension",
    ast.JoinedStr: "string",
    ast.NamedExpr: "assignment expression",
    ast.Starred: "starred expression",
    ast.Slice: "slice",
    ast.Tuple: "tuple",
    ast.Pow: "power",
    ast.FloorDiv: "floor division or remainder",
    ast.Mod: "floor division or remainder",
    ast.MatMult: "matrix product",
    ast.BitAnd: "bit operation",
    ast.BitOr: "bit operation",
    ast.BitXor: "bit operation",
    ast.LShift: "bit operation",
    ast.RShift: "bit operation",
    ast.Invert: "bit operation",
    ast.Is: "identity or membership test",
    ast.IsNot: "identity or membership test",
    ast.In: "identity or membership test",
    ast.NotIn: "identity or membership test",
}
"""Construct of a syntax node that is always refused."""


def construct_of(node: ast.AST) -> str:
    """Return the construct of a node that has no translation."""
    if isinstance(node, ast.Constant):
        if node.value is None:
            return "None"
        if isinstance(node.value, str | bytes):
            return "string"
        return "complex number" if isinstance(node.value, complex) else "constant"
    known = STATEMENTS.get(type(node))
    if known is not None:
        return known
    return "statement" if isinstance(node, ast.stmt) else "expression"
