"""C generated from Python's laws, in double, has Python's bits on random and boundary values."""

from __future__ import annotations

import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flightstack.control import mixer as mixing
from flightstack.control.attitude_backstepping import attitude_backstepping_step
from flightstack.control.attitude_pid import attitude_pid_step
from flightstack.control.attitude_reference import attitude_reference_step, in_body_frame
from flightstack.control.control_law import AttitudeController
from flightstack.control.position_pid import position_pid_step
from flightstack.core import geometry, portable_math
from flightstack.core.compiled import compiled
from flightstack.core.contract import Vector3, Wrench
from flightstack.firmware.c_loops import LoopsSetup
from flightstack.firmware.generator.call_c import CFunction, Vectors, differences
from flightstack.firmware.generator.unit import Program
from flightstack.firmware.sources import firmware_root
from flightstack.firmware.targets import make_loops
from flightstack.firmware.toolchain.build import EXACT
from flightstack.guidance.trajectory import setpoint_of, trajectory_step
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle
from tests.firmware.core_support import run_tool
from tests.parity import generated_laws as laws
from tests.parity.generated_filter import FILTERS, AttitudeFilter, FilterNoise
from tests.parity.generated_laws import LAWS
from tests.parity.generated_records import RECORDS
from tests.support.bare_target import without_estimator
from tests.support.generated_c import WARNINGS, compile_program, in_python
from tests.support.plugin_site import example_module
from tests.support.rotor_sets import ring
from tests.support.tools import NIGHTLY

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
EVERY = {**OWN, **LAWS, **FILTERS, **RECORDS, "LQR": example_module().step}


@compiled
def whole_numbers(x: float, y: float) -> tuple[float, float, float, float, float]:
    below = math.floor(min(max(x, -9.0), 9.0))
    product = below * -2
    product *= math.floor(0.5)
    signed = float(-below) if y > 0.0 else float(product)
    return math.floor(x) * 1.0, math.floor(x / y) + 0.5, float(int(y)), math.copysign(x, -y), signed


class Built:
    """All laws in one library."""

    def __init__(self, folder: Path) -> None:
        program = Program()
        self.functions = {name: program.add(law) for name, law in EVERY.items()}
        self.mix = program.add(mixing.mix)
        self.speed = program.add(mixing.relative_rotor_speed)
        self.whole = program.add(whole_numbers)
        self.library = compile_program(program, folder)


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Built:
    return Built(tmp_path_factory.mktemp("laws"))


@pytest.mark.parametrize("name", EVERY)
def test_generated_law_has_pythons_bits(name: str, built: Built) -> None:
    function = built.functions[name]
    vectors = Vectors(len(name)), Vectors(len(name) + 1, edges=0.0)
    count = {"covariance of 24 states": 4, "fusion": 20}.get(name, COUNT)
    samples = [made.arguments(function) for made in vectors for _ in range(count)]
    if name == "logarithm":
        samples = [[abs(value)] for (value,) in samples if 0.0 < abs(value) < np.inf]
    assert not differences(CFunction(built.library, function), in_python(EVERY[name]), samples)


def test_generated_attitude_filter_finds_tilt_and_bias(built: Built) -> None:
    """It is a filter, not only arithmetic: 0.3 rad of roll and 0.05 rad/s of bias, from nothing."""
    step = CFunction(built.library, built.functions["attitude filter"])
    state = AttitudeFilter(np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3), 0.1 * np.eye(6), 0.0)
    force = Vector3(0.0, -9.81 * math.sin(0.3), -9.81 * math.cos(0.3))
    for _ in range(4000):
        step(state, Vector3(0.05, 0.0, 0.0), force, FilterNoise(1e-5, 1e-6, 1e-3), 0.01)
    roll = 2.0 * math.atan2(state.attitude[1], state.attitude[0])
    assert roll == pytest.approx(0.3, abs=1e-3)
    assert state.bias_rad_s == pytest.approx([0.05, 0.0, 0.0], abs=1e-3)


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


def test_whole_numbers_are_pythons(built: Built) -> None:
    sizes = [
        0.0,
        -0.0,
        0.3,
        -0.3,
        0.5,
        -0.5,
        1.0,
        -1.0,
        2.0**31 - 200.0,
        1e9 + 0.5,
        2.0**52 - 0.5,
        -(2.0**52) + 0.5,
    ]
    samples = [
        (np.float64(x), np.float64(y)) for x in [*sizes, 2.0**53, -1e300] for y in sizes if abs(y) < 2.0**31
    ]
    assert not differences(CFunction(built.library, built.whole), in_python(whole_numbers), samples)


def test_functions_of_exponents_are_pythons_at_the_ends_of_their_range(built: Built) -> None:
    random = np.random.default_rng(5)
    samples = [
        [np.float64(x)] for x in (*random.uniform(-746.0, 710.0, 400), *np.linspace(-745.2, -707.0, 200))
    ]
    exponential = CFunction(built.library, built.functions["exponential"])
    assert not differences(exponential, in_python(portable_math.exp), samples)
    numbers = [[np.float64(10.0**x)] for x in random.uniform(-323.0, 308.0, 400)]
    logarithm = CFunction(built.library, built.functions["logarithm"])
    assert not differences(
        logarithm, in_python(portable_math.log), [*numbers, [np.float64(5e-324)], [np.float64(1.0)]]
    )


def test_difference_in_the_last_bit_is_found(built: Built) -> None:
    distance = CFunction(built.library, built.functions["distance"])
    python = in_python(portable_math.distance)
    sample = [[np.float64(0.1), np.float64(0.2), np.float64(0.3)]]
    assert not differences(distance, python, sample)
    assert differences(distance, lambda *values: np.nextafter(python(*values), 9.0), sample)


@pytest.mark.skipif(not NIGHTLY, reason="compiles each law with Numba")
@pytest.mark.parametrize("name", [*LAWS, *FILTERS, *RECORDS, "LQR", "trajectory"])
def test_generated_law_has_the_bits_of_numba(name: str, built: Built) -> None:
    function = built.functions[name]
    vectors = Vectors(9, edges=0.0 if name == "trajectory" else 0.02)  # compiled, math.floor of NaN is -2**63
    samples = [vectors.arguments(function) for _ in range(500)]
    assert not differences(CFunction(built.library, function), EVERY[name], samples)


def test_generated_laws_compile_without_a_warning_in_float(tmp_path: Path) -> None:
    program = Program()
    for law in EVERY.values():
        program.add(law)
    compile_program(program, tmp_path, "float")
    if shutil.which("avr-gcc"):  # an int of 16 bits
        root = firmware_root()
        flags = [
            "-mmcu=atmega1284p",
            "-ffreestanding",
            *EXACT,
            *WARNINGS,
            *(f"-I{root / n}" for n in ("core", "laws")),
        ]
        for source in sorted(tmp_path.glob("*.c")):
            run_tool(["avr-gcc", *flags, "-c", source, "-o", tmp_path / "law.o"])


def controller(name: str, values: tuple[float, ...], *parts: Any) -> AttitudeController:
    """Return a controller of a law of ``generated_laws`` with these parameters."""
    step, memory, params, initial = parts
    return AttitudeController(name, step, memory, params, initial, lambda vehicle, gains: values)


CONTROLLERS = [
    controller("neural", (0.2,), laws.neural_step, laws.GeometricMemory, laws.NeuralParams, (0.0,)),
    controller(
        "sliding", (4.0, 3.0, 2.0, 0.1, 0.01, 0.01, 0.02), laws.sliding_mode_step, laws.SlidingMemory,
        laws.SlidingParams, (0.0, 0.0, 0.0),
    ),
    controller("mrac", (10.0, 0.7, 0.5, 3.0), laws.mrac_step, laws.MracMemory, laws.MracParams, (0.0,) * 4),
]  # fmt: skip


@pytest.mark.parametrize("law", CONTROLLERS if NIGHTLY else CONTROLLERS[1:2], ids=lambda law: law.name)
def test_generated_law_has_the_same_bits_on_the_emulated_target(law: AttitudeController) -> None:
    setup = LoopsSetup(load_vehicle("x_quad"), law, open_gains("tuned"), 0.6, 500.0, 100.0, 5)
    with without_estimator():
        here, there = (make_loops(loops, setup) for loops in ("c", "emulated"))
    rows, random = (np.zeros(48), np.zeros(48)), np.random.default_rng(1)
    for loops in (here, there):
        loops.reset(np.array([0.0] * 6 + [1.0] + [0.0] * 6))
    for tick in range(600):
        attitude = np.array([1.0, *random.normal(0.0, 0.1, 3)])
        attitude /= np.linalg.norm(attitude)
        state = np.concatenate([random.normal(size=6), attitude, random.normal(0.0, 0.5, 3)])
        setpoint = random.normal(size=11)
        for loops, row in zip((here, there), rows, strict=True):
            loops.step(state, setpoint, np.zeros(8, np.float32), tick % 5 == 0, row)
        assert rows[0].tobytes() == rows[1].tobytes(), tick
    here.close()
    there.close()
