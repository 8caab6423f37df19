"""Functions of plain arithmetic against extended precision, and that the flight uses no others."""

from __future__ import annotations

import ast
import math
from pathlib import Path

import numpy as np
import pytest

from flightstack.core import portable_math
from flightstack.core.compiled import compiled
from flightstack.core.portable_math import acos, asin, atan2, exp, log, sin_cos, tan
from tests.support.tools import NIGHTLY

ROOT = Path(__file__).resolve().parents[2]
COUNT = 1_000_000 if NIGHTLY else 200_000
WORST_ULPS = {
    "sine": 1.5,
    "cosine": 1.5,
    "tan": 3.0,
    "atan2": 3.2,
    "asin": 3.6,
    "acos": 3.6,
    "exp": 1.0,
    "log": 1.7,
}
"""Bounds; measured 1.31, 1.41, 2.82, 2.99, 3.23, 3.30, 0.96 and 1.50."""


@compiled
def compute(x, y, made):  # type: ignore[no-untyped-def]
    for i in range(x.size):
        made[0, i], made[1, i] = sin_cos(x[i])
        made[2, i], made[3, i] = tan(x[i]), atan2(y[i], x[i])
        made[4, i], made[5, i] = asin(y[i]), acos(y[i])
        made[6, i], made[7, i] = exp(100.0 * x[i]), log(abs(y[i]))


def arguments(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Angles within a turn, and numbers in [−1, 1], half of them of any size."""
    random = np.random.default_rng(8)
    small = 10.0 ** random.uniform(-16.0, 0.0, count) * random.choice([-1.0, 1.0], count)
    values = np.where(random.random(count) < 0.5, random.uniform(-1.0, 1.0, count), small)
    return random.uniform(-math.pi, math.pi, count), values


@pytest.mark.skipif(np.finfo(np.longdouble).nmant < 60, reason="no number type here is finer than double")
def test_portable_functions_are_within_their_ulps() -> None:
    x, y = arguments(COUNT)
    made = np.zeros((len(WORST_ULPS), COUNT))
    compute(x, y, made)
    fine, size = x.astype(np.longdouble), y.astype(np.longdouble)
    true = (
        *(np.sin(fine), np.cos(fine), np.tan(fine), np.arctan2(size, fine)),
        *(np.arcsin(size), np.arccos(size), np.exp((100.0 * x).astype(np.longdouble)), np.log(abs(size))),
    )
    for (name, most), got, wanted in zip(WORST_ULPS.items(), made, true, strict=True):
        apart = np.abs(got - wanted) / np.spacing(np.abs(wanted.astype(np.float64)))
        assert float(apart.max()) < most, name


def test_portable_functions_have_the_same_bits_without_numba() -> None:
    x, y = arguments(2000)
    made = np.zeros((len(WORST_ULPS), x.size))
    compute(x, y, made)
    for index, (angle, value) in enumerate(zip(x.tolist(), y.tolist(), strict=True)):
        plain = *sin_cos(angle), tan(angle), atan2(value, angle), asin(value), acos(value), exp(100.0 * angle)
        assert made[:, index].tolist() == [*plain, log(abs(value))]


def test_atan2_of_zeros_and_extremes_is_that_of_ieee() -> None:
    for y in (0.0, -0.0, 1.0, -1.0, 1e-300, math.inf, -math.inf):
        for x in (0.0, -0.0, 1.0, -1.0, -1e-300, 1e300):
            expected = math.atan2(y, x)
            assert atan2(y, x) == pytest.approx(expected, rel=1e-15), (y, x)
            assert math.copysign(1.0, atan2(y, x)) == math.copysign(1.0, expected), (y, x)


def test_what_has_no_answer_is_nan() -> None:
    for angle in (1.0001e4, -1.0001e4, math.inf, math.nan):
        assert all(map(math.isnan, sin_cos(angle)))
    assert math.isnan(atan2(math.nan, 1.0))
    assert math.isnan(atan2(1.0, math.nan))
    assert math.isnan(exp(math.nan))
    assert (exp(-800.0), exp(-math.inf), exp(math.inf), exp(0.0), log(1.0)) == (0.0, 0.0, math.inf, 1.0, 0.0)


# ------------------------------------------------------------------ nothing else is used

LIBM = {
    *(
        "sin",
        "cos",
        "tan",
        "asin",
        "acos",
        "atan",
        "atan2",
        "sinh",
        "cosh",
        "tanh",
        "exp",
        "exp2",
        "expm1",
        "log",
    ),
    *("log2", "log10", "log1p", "pow", "cbrt", "hypot", "dist", "gamma", "lgamma", "erf", "erfc"),
    *(
        "arcsin",
        "arccos",
        "arctan",
        "arctan2",
        "power",
        "float_power",
        "dot",
        "matmul",
        "inner",
        "vdot",
        "einsum",
    ),
    *("linalg", "random", "default_rng", "Generator", "norm", "interp", "polyfit", "polyval", "cross"),
}
NOT_FLIGHT = (
    "sim_bridge/multibody/",  # MuJoCo's own arithmetic: docs/explanation/decisions.md
    "sim_bridge/render/",  # pictures
    "flightstack/services/telemetry/motion.py",  # what ground stations are shown
    "flightstack/estimation/motion_covariance.py",  # the same
    "flightstack/core/geometry_bulk.py",  # reports
    "flightstack/firmware/generator/",  # before a flight
    "flightstack/flight_log/poses_file.py",  # pictures
    "flightstack/testing/flight.py",  # figures of a flown flight
    "flightstack/testing/flight_signals.py",  # the same
    "flightstack/testing/expectations.py",
    "flightstack/testing/link.py",  # random.Random of lossy links, integers alone
    "flightstack/plan/fence_shape.py",  # whether a plan is accepted
    "flightstack/transports/memory.py",  # random.Random of a lossy line, integers alone
)
ALLOWED = {
    ("flightstack/params/vehicle.py", "linalg"),  # whether a vehicle is accepted: the rank of its rotors
    ("sim_bridge/plant/turbulence.py", "random"),  # PCG64, integers alone
    ("sim_bridge/sensors/noise.py", "random"),  # PCG64, integers alone
}


def uses_of_libraries(path: Path) -> set[tuple[str, str]]:
    """Names of libm, BLAS, LAPACK and NumPy's random numbers in a module, and powers of what is no constant."""
    name = path.relative_to(ROOT).as_posix()
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id in ("math", "np", "numpy") and node.attr in LIBM:
                found.add((name, node.attr))
        elif isinstance(node, ast.ImportFrom) and node.module in ("math", "numpy", "numpy.linalg"):
            found |= {(name, alias.name) for alias in node.names if alias.name in LIBM}
        elif isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow | ast.MatMult):
            operands = (node.left, node.right)
            if isinstance(node.op, ast.MatMult) or not all(
                isinstance(part, ast.Constant) for part in operands
            ):
                found.add((name, type(node.op).__name__))
    return found


def test_flight_uses_no_function_whose_bits_depend_on_the_processor() -> None:
    found = set[tuple[str, str]]()
    for package in ("flightstack", "sim_bridge"):
        for path in sorted((ROOT / package).rglob("*.py")):
            if not path.relative_to(ROOT).as_posix().startswith(NOT_FLIGHT):
                found |= uses_of_libraries(path)
    assert found == ALLOWED


def test_compiled_code_contracts_and_calls_nothing() -> None:
    compute(np.zeros(1), np.zeros(1), np.zeros((len(WORST_ULPS), 1)))  # compiles it, if it is the first here
    assembly = "".join(compute.inspect_asm().values())
    assert "vmulsd" in assembly or "mulsd" in assembly or "fmul" in assembly
    for word in (
        "vfmadd",
        "vfnmadd",
        "vfmsub",
        "fmadd\t",
        "fmla\t",
        "__svml",
        "atan2@",
        "\tsin\n",
        "\texp\n",
    ):
        assert word not in assembly


def test_all_functions_are_known_to_compiled_code() -> None:
    public = {name for name, value in vars(portable_math).items() if callable(value) and name[0] != "_"}
    assert public == {function.__name__ for function in portable_math.FUNCTIONS}
