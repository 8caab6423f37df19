"""Sine, cosine and the angle of a rotation in the core, against the extended precision of the host."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.firmware.core_support import Core, ulps
from tests.support.tools import NIGHTLY

COUNT = 1_000_000 if NIGHTLY else 200_000
REALS = ("float", "double")

if np.finfo(np.longdouble).nmant < 60:
    pytest.skip("no number type here is finer than double", allow_module_level=True)


def evaluate(real: str, y: np.ndarray, x: np.ndarray) -> tuple[Core, list[np.ndarray], list[np.ndarray]]:
    """Return the core's sine and cosine of x and angle of the quaternion (x, y, 0, 0), and the true ones, finer."""
    core = Core(real)
    y, x = core.array(y), core.array(x)
    out = [np.zeros(x.size, core.dtype) for _ in range(3)]
    core.call("drive_math", x.size, y, x, *out)
    wide_y, wide_x = y.astype(np.longdouble), x.astype(np.longdouble)
    with np.errstate(invalid="ignore", divide="ignore"):
        return core, out, [np.sin(wide_x), np.cos(wide_x), 2.0 * np.arctan(wide_y / wide_x)]


@pytest.mark.parametrize("real", REALS)
def test_errors_within_a_turn_are_few_units_of_the_last_place(real: str) -> None:
    random = np.random.default_rng(1)
    core, made, true = evaluate(real, random.normal(size=COUNT), random.uniform(-math.pi, math.pi, COUNT))
    for name, got, wanted in zip(("sine", "cosine", "angle"), made, true, strict=True):
        worst = ulps((got - wanted).astype(np.float64), wanted.astype(np.float64), core.dtype).max()
        assert worst < (5.0 if name == "angle" else 2.0), name  # measured 1.4 both, 2.7 (float), 4.1 (double)


@pytest.mark.parametrize("real", REALS)
def test_large_angles_lose_nothing_but_what_they_have_not(real: str) -> None:
    random = np.random.default_rng(2)
    core, made, true = evaluate(real, np.zeros(COUNT), random.uniform(-1e4, 1e4, COUNT))
    unit = np.spacing(core.dtype.type(1.0))
    for got, wanted in zip(made[:2], true[:2], strict=True):
        assert np.abs(got - wanted).max() < unit  # measured 0.65 of the last place of 1


@pytest.mark.parametrize("real", REALS)
def test_the_angle_is_found_in_every_quadrant_and_size(real: str) -> None:
    random = np.random.default_rng(3)
    sizes = 10.0 ** random.uniform(-15.0, 15.0, (2, COUNT)) * random.choice([-1.0, 1.0], (2, COUNT))
    core, made, true = evaluate(real, *sizes)
    assert ulps((made[2] - true[2]).astype(np.float64), true[2].astype(np.float64), core.dtype).max() < 5.0


@pytest.mark.parametrize("real", REALS)
def test_no_turn_has_no_angle_and_half_a_turn_has_pi(real: str) -> None:
    y = np.array([0.0, 0.0, 1.0, -1.0, 0.0, -0.0, -0.0])
    x = np.array([1.0, -1.0, 0.0, 0.0, 0.0, -0.0, -1.0])
    core, made, _ = evaluate(real, y, x)
    expected = core.array([0.0, 0.0, math.pi, -math.pi, 0.0, 0.0, 0.0])
    assert np.abs(made[2] - expected).max() <= np.spacing(core.dtype.type(math.pi))


@pytest.mark.parametrize("real", REALS)
def test_what_has_no_answer_is_not_a_number(real: str) -> None:
    beyond = np.array([10001.0, -10001.0, 3e38, np.inf, -np.inf, np.nan])
    _, made, _ = evaluate(real, np.array([np.nan, np.inf, 1.0, 1.0, -1.0, 0.0]), beyond)
    assert np.isnan(made[0]).all()
    assert np.isnan(made[1]).all()
    assert np.isnan(made[2]).tolist() == [True, True, False, False, False, True]
    _, made, _ = evaluate(real, np.ones(2), np.array([10_000.0, -10_000.0]))
    assert np.isfinite(made[:2]).all()
