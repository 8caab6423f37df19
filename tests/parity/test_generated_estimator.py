"""The estimator's functions go through the generator: C in double has Python's bits."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from flightstack.estimation import (
    alignment,
    derived_generated,
    fusion,
    imu_input,
    kalman,
    prediction,
    yaw_estimator,
)
from flightstack.firmware.generator.call_c import CFunction, Vectors, differences
from flightstack.firmware.generator.unit import Program
from tests.support.generated_c import compile_program, in_python

COUNT = 4
FUNCTIONS: dict[str, Callable[..., Any]] = {
    "prediction": prediction.predict,
    "prediction of errors": prediction.predict_errors,
    "covariance": derived_generated.predict_covariance,
    "scalar fusion": kalman.fuse,
    "reset of a variance": kalman.reset_variance,
    "drift of GNSS": fusion.drift_gnss_bias,
    "GNSS velocity": fusion.fuse_gnss_velocity,
    "GNSS position": fusion.fuse_gnss_position,
    "barometer": fusion.fuse_baro,
    "range": fusion.fuse_range,
    "field": fusion.fuse_field_axis,
    "drag": fusion.fuse_drag,
    "rest": fusion.fuse_rest_velocity,
    "rate at rest": fusion.fuse_rest_rate,
    "held position": fusion.fuse_hold,
    "IMU sums": imu_input.add_sample,
    "alignment": alignment.align,
    "yaw models": yaw_estimator.predict_models,
    "weights of yaw models": yaw_estimator.update_models,
    "yaw of models": yaw_estimator.mean_turn,
}
_AXIS = {"axis": 1}
_BOUNDS = {
    "reset of a variance": {"at": 3, "count": 4},
    "scalar fusion": {"row": 6},
    "GNSS velocity": _AXIS,
    "GNSS position": {"axis": 2},
    "field": _AXIS,
    "drag": _AXIS,
    "rest": _AXIS,
    "rate at rest": _AXIS,
    "held position": _AXIS,
}
"""Integers that a caller gives, within the arrays."""


@pytest.fixture(scope="module")
def program() -> Program:
    made = Program()
    for function in FUNCTIONS.values():
        made.add(function)
    return made


@pytest.fixture(scope="module")
def library(program: Program, tmp_path_factory: pytest.TempPathFactory) -> Any:
    return compile_program(program, tmp_path_factory.mktemp("estimator"))


@pytest.mark.parametrize("name", FUNCTIONS)
def test_estimator_in_generated_c_has_pythons_bits(name: str, program: Program, library: Any) -> None:
    function = program.add(FUNCTIONS[name])
    vectors, samples = Vectors(len(name), edges=0.0), []
    for _ in range(COUNT):
        values = vectors.arguments(function)
        names = [parameter.name for parameter in function.parameters]
        for bound, value in _BOUNDS.get(name, {}).items():
            values[names.index(bound)] = value
        samples.append(values)
    assert not differences(CFunction(library, function), in_python(FUNCTIONS[name]), samples)


def test_estimator_in_generated_c_compiles_without_a_warning_in_float(
    program: Program, tmp_path: Path
) -> None:
    assert compile_program(program, tmp_path, "float")
