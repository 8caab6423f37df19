"""Plain loops against LAPACK."""

from __future__ import annotations

import numpy as np
import pytest

from flightstack.core.linear_algebra import largest_eigenvalue, pseudo_inverse
from flightstack.params.vehicle import built_in_vehicles, load_vehicle
from tests.support.rotor_sets import ring


@pytest.mark.parametrize("name", [*built_in_vehicles(), "hexa", "octo"])
def test_allocation_of_a_vehicle_is_numpys_pseudo_inverse(name: str) -> None:
    rings = {"hexa": 6, "octo": 8}
    vehicle = ring(rings[name]) if name in rings else load_vehicle(name)
    expected, made = np.linalg.pinv(vehicle.effectiveness()), vehicle.allocation()
    assert (
        np.abs(made - expected).max(axis=0) < 1e-13 * np.abs(expected).max(axis=0)
    ).all()  # measured 3.5e-14
    undone = vehicle.effectiveness() @ made
    assert np.abs(undone - np.eye(4)).max() < 5e-15  # measured 1.3e-15, NumPy's 1.9e-14


@pytest.mark.parametrize("columns", [4, 5, 6, 8])
def test_pseudo_inverse_of_any_rows_is_numpys_to_their_condition(columns: int) -> None:
    random = np.random.default_rng(columns)
    for _ in range(100):
        scale = 10.0 ** random.uniform(-8.0, 0.0, (4, 1))
        matrix = random.normal(size=(4, columns)) * scale
        expected = np.linalg.pinv(matrix / scale) / scale.T
        apart = np.abs(pseudo_inverse(matrix) - expected).max(axis=0) / np.abs(expected).max(axis=0)
        assert apart.max() < 1e-14 * np.linalg.cond(matrix / scale)


def test_pseudo_inverse_of_dependent_rows_is_numpys() -> None:
    random = np.random.default_rng(6)
    without_drag = load_vehicle("x_quad").effectiveness()
    without_drag[3] = 0.0
    matrices = [without_drag, np.zeros((4, 6)), np.array([[0.0, 0.0], [1.0, 2.0], [2.0, 4.0]])]
    matrices += [random.normal(size=(4, rank)) @ random.normal(size=(rank, 6)) for rank in (1, 2, 3)]
    for matrix in matrices:
        expected = np.linalg.pinv(matrix, rcond=1e-12)
        assert pseudo_inverse(matrix) == pytest.approx(
            expected, rel=1e-11, abs=1e-13 * np.abs(expected).max()
        )


def test_largest_eigenvalue_is_numpys() -> None:
    random = np.random.default_rng(3)
    for size in (1, 2, 6):
        for _ in range(50):
            half = random.normal(size=(size, size))
            matrix = half @ half.T
            assert largest_eigenvalue(matrix) == pytest.approx(np.linalg.eigvalsh(matrix).max(), rel=1e-13)
    assert largest_eigenvalue(np.diag([1.0, -7.0, 3.0])) == 3.0
