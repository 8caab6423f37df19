"""C generated from Python's laws, in double, has Python's bits on random and boundary values."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flightstack.control import mixer as mixing
from flightstack.control.attitude_backstepping import attitude_backstepping_step
from flightstack.control.attitude_pid import attitude_pid_step
from flightstack.control.attitude_reference import attitude_reference_step, in_body_frame
from flightstack.control.position_pid import position_pid_step
from flightstack.core import geometry, portable_math
from flightstack.core.contract import Vector3, Wrench
from flightstack.firmware.generator.call_c import CFunction, Vectors, differences
from flightstack.firmware.generator.unit import Program
from flightstack.guidance.trajectory import setpoint_of, trajectory_step
from flightstack.params.vehicle import load_vehicle
from tests.parity.generated_laws import LAWS
from tests.support.generated_c import compile_program, in_python
from tests.support.plugin_site import example_module
from tests.support.rotor_sets import ring

COUNT = 150
OWN: dict[str, Callable[..., Any]] = {
    "PID": attitude_pid_step,
    "backstepping": attitude_backstepping_step,
    "attitude reference": attitude_reference_step,
    "body frame": in_body_frame,
    "position PID": position_pid_step,
    "trajectory": trajectory_step,
    "setpoint": setpoint_of,
    "blend": geometry.blend,
    "rotation vector": geometry.rotation_vector,
    "Euler angles": geometry.euler_from_quaternion,
    "quaternion": geometry.quaternion_from_euler,
    "arc tangent": portable_math.atan2,
    "arc sine": portable_math.asin,
    "exponential": portable_math.exp,
    "logarithm": portable_math.log,
    "distance": portable_math.distance,
}
EVERY = {**OWN, **LAWS, "LQR": example_module().step}


class Built:
    """All laws in one library."""

    def __init__(self, folder: Path) -> None:
        program = Program()
        self.functions = {name: program.add(law) for name, law in EVERY.items()}
        self.mix = program.add(mixing.mix)
        self.speed = program.add(mixing.relative_rotor_speed)
        self.library = compile_program(program, folder)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return Built(tmp_path_factory.mktemp("laws"))


@pytest.mark.parametrize("name", EVERY)
def test_generated_law_has_pythons_bits(name: str, built: Built) -> None:
    function = built.functions[name]
    vectors = Vectors(len(name)), Vectors(len(name) + 1, edges=0.0)
    samples = [made.arguments(function) for made in vectors for _ in range(COUNT)]
    if name == "logarithm":
        samples = [[abs(value)] for (value,) in samples if 0.0 < abs(value) < np.inf]
    assert not differences(CFunction(built.library, function), in_python(EVERY[name]), samples)


@pytest.mark.parametrize("vehicle", ["plus", "octo", "unlike"])
def test_generated_mixer_has_pythons_bits(vehicle: str, built: Built) -> None:
    rotors = mixing.mixer_for(ring(8, first_deg=22.5) if vehicle == "octo" else load_vehicle("paper_quad"))
    if vehicle == "unlike":
        rotors = mixing.derived(
            rotors.allocation, rotors.effectiveness, rotors.low, 0.9 * rotors.high, rotors.spin
        )
        rotors = rotors._replace(is_even=0.0)
    n, random = rotors.spin.size, np.random.default_rng(n_seed := 7)
    assert n_seed
    mix, python = CFunction(built.library, built.mix), in_python(mixing.mix)
    weight = 4.0
    for size in (0.1, 1.0, 10.0):
        for _ in range(60):
            numbers = random.normal(size=4) * [weight, size, size, 0.1 * size] + [weight, 0.0, 0.0, 0.0]
            wrench = Wrench(np.float64(numbers[0]), Vector3(*numbers[1:]))
            speeds, work = (np.zeros(n), np.zeros(n)), (np.zeros((3, n)), np.zeros((3, n)))
            with np.errstate(all="ignore"):
                wanted = python(wrench, rotors, speeds[0], work[0])
            made = mix(wrench, rotors, speeds[1], work[1], rotors=n)
            assert np.array([wanted[0], *wanted[1]]).tobytes() == np.array(made).tobytes()
            assert speeds[0].tobytes() == speeds[1].tobytes()
