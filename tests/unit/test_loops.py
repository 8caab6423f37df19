"""The loops as the backend runs them: order of the steps, reset, inputs and outputs that are not finite."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from flightstack.control.attitude_backstepping import CONTROLLER as BACKSTEPPING
from flightstack.control.attitude_pid import CONTROLLER as PID
from flightstack.control.control_law import AttitudeController, AttitudeInputs, ControlLaw, NoMemory, NoParams
from flightstack.control.loops import PythonLoops
from flightstack.control.mixer import mixer_for
from flightstack.core.compiled import compiled
from flightstack.core.contract import LoopRow, LoopStatus, Vector3
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle
from tests.support.failing_controller import CONTROLLER as FAILING

PAPER = load_vehicle("paper_quad")
HELD = LoopStatus.INPUT_NOT_FINITE | LoopStatus.OUTPUT_NOT_FINITE
SPEEDS = np.zeros(8, np.float32)
HOVER_SPEED = math.sqrt(PAPER.weight_n / (4 * 2.93e-5))


def make(controller: AttitudeController = PID, gains: str = "tuned", inner_hz: float = 500.0) -> PythonLoops:
    return PythonLoops(PAPER, controller, open_gains(gains), inner_hz, 100.0, math.radians(45.0))


def at_rest(position=(0.0, 0.0, 0.0), rates=(0.0, 0.0, 0.0)) -> np.ndarray:
    return np.array([*position, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, *rates])


def setpoint(position=(0.0, 0.0, 0.0), yaw: float = 0.0) -> np.ndarray:
    return np.array([*position, *[0.0] * 6, yaw, 0.0])


def memories(loops: PythonLoops) -> list[np.ndarray]:
    return [loops.memory[0]["reference"], *loops.memories.values()]


class Flight:
    """A backend stepped at fixed inputs; ``rows`` are copies of what it wrote."""

    def __init__(self, loops: PythonLoops, state: np.ndarray, wish: np.ndarray) -> None:
        self.loops, self.state, self.wish = loops, state, wish
        self.rows: list[np.ndarray] = []
        loops.reset(state)

    def tick(self, count: int = 1) -> np.ndarray:
        for _ in range(count):
            row = np.zeros(LoopRow.SIZE)
            self.loops.step(self.state, self.wish, SPEEDS, len(self.rows) % 5 == 0, row)
            self.rows.append(row)
        return self.rows[-1]


def test_level_at_the_setpoint_the_rotors_carry_the_weight() -> None:
    for controller in (PID, BACKSTEPPING):
        row = Flight(make(controller), at_rest(), setpoint()).tick()
        assert row[LoopRow.ROTOR_COMMAND][:4] == pytest.approx([HOVER_SPEED] * 4, rel=1e-12)
        assert row[LoopRow.ROTOR_COMMAND][4:].tolist() == [0.0] * 4
        assert row[LoopRow.WRENCH] == pytest.approx([PAPER.weight_n, 0.0, 0.0, 0.0], abs=1e-12)
        assert row[LoopRow.STATUS] == 0.0
        assert row[LoopRow.STATE].tolist() == at_rest().tolist()


def test_signs_from_a_position_error_to_the_rotors() -> None:
    """A goal ahead: nose down, so the back rotor (3) is faster; to the right: the left rotor (4)."""
    ahead = Flight(make(), at_rest(), setpoint((1.0, 0.0, 0.0))).tick(3)[LoopRow.ROTOR_COMMAND]
    assert ahead[2] > HOVER_SPEED > ahead[0]
    right = Flight(make(), at_rest(), setpoint((0.0, 1.0, 0.0))).tick(3)[LoopRow.ROTOR_COMMAND]
    assert right[3] > HOVER_SPEED > right[1]
    above = Flight(make(), at_rest(), setpoint((0.0, 0.0, -0.5))).tick()[LoopRow.ROTOR_COMMAND]
    assert above[:4].min() > HOVER_SPEED
    # turning right needs the counter-clockwise rotors (2, 4): their drag turns the body clockwise
    turned = Flight(make(), at_rest(), setpoint(yaw=0.5)).tick(3)[LoopRow.ROTOR_COMMAND]
    assert turned[1] == pytest.approx(turned[3])
    assert turned[1] > turned[0] == pytest.approx(turned[2])


def test_the_outer_loop_runs_only_when_it_is_due() -> None:
    flight = Flight(make(), at_rest(), setpoint((0.3, 0.0, 0.0)))
    flight.tick()
    first = flight.loops.attitude_target.copy()
    flight.wish = setpoint((0.0, 0.4, 0.0))
    flight.tick(4)
    assert flight.loops.attitude_target.tolist() == first.tolist()
    flight.tick()
    assert flight.loops.attitude_target.tolist() != first.tolist()


def test_between_outer_ticks_the_target_moves_in_a_straight_line() -> None:
    """Without the reference filter, the reference is the target: a fifth of the way in each of five ticks."""
    loops = make()
    loops.memory[0]["reference_params"][0] = 0.0
    flight = Flight(loops, at_rest(), setpoint((0.4, 0.0, 0.0)))
    flight.tick(5)
    w, x, y, z = loops.attitude_target[:4]
    way = Slerp([0.0, 1.0], Rotation.from_quat([[0.0, 0.0, 0.0, 1.0], [x, y, z, w]]))
    for tick, row in enumerate(flight.rows, start=1):
        q = row[LoopRow.REFERENCE_ATTITUDE]
        off = way(tick / 5).inv() * Rotation.from_quat([q[1], q[2], q[3], q[0]])
        assert off.magnitude() < 3e-4  # chord for arc over 0.34 rad: 1.6e-4 rad seen


def test_reset_forgets_everything() -> None:
    fresh, used = make(), make()
    Flight(used, at_rest(rates=(0.5, -0.3, 0.2)), setpoint((2.0, -1.0, -3.0), 1.0)).tick(200)
    rows = [Flight(loops, at_rest(), setpoint((0.1, 0.2, -0.1))) for loops in (fresh, used)]
    for flight in rows:
        flight.tick(20)
    assert np.array_equal(rows[0].rows, rows[1].rows)


def test_idle_rotors_turn_slowly_when_armed_and_not_at_all_when_disarmed() -> None:
    loops, row = make(), np.full(LoopRow.SIZE, 7.0)
    speeds = np.arange(8, dtype=np.float32)
    loops.idle(at_rest((1.0, 2.0, 3.0)), speeds, True, row)
    assert row[LoopRow.ROTOR_COMMAND].tolist() == [30.0] * 4 + [0.0] * 4
    assert row[LoopRow.ROTOR_SPEED].tolist() == speeds.tolist()
    assert row[LoopRow.STATE][:3].tolist() == [1.0, 2.0, 3.0]
    assert row[LoopRow.STATUS] == LoopStatus.IDLE
    loops.idle(at_rest(), speeds, False, row)
    assert row[LoopRow.ROTOR_COMMAND].tolist() == [0.0] * 8


def test_a_state_that_is_not_finite_repeats_the_last_row_with_a_status_bit() -> None:
    undisturbed = Flight(make(), at_rest(), setpoint((0.3, 0.1, -0.2)))
    undisturbed.tick(12)
    for column, bad in itertools.product(range(13), [math.nan, math.inf, -math.inf]):
        flight = Flight(make(), at_rest(), setpoint((0.3, 0.1, -0.2)))
        good = flight.tick(12)
        flight.state = at_rest()
        flight.state[column] = bad
        held = flight.tick(13)
        assert held[LoopRow.STATUS] == LoopStatus.INPUT_NOT_FINITE, (column, bad)
        assert held[: LoopRow.STATUS].tolist() == good[: LoopRow.STATUS].tolist(), (column, bad)
        # nothing was integrated meanwhile
        for kept, expected in zip(memories(flight.loops), memories(undisturbed.loops), strict=True):
            assert kept.tolist() == expected.tolist(), (column, bad)
        flight.state = at_rest()
        row = flight.tick()
        assert np.isfinite(row).all(), (column, bad)
        assert not int(row[LoopRow.STATUS]) & HELD, (column, bad)


@pytest.mark.parametrize("controller", [PID, BACKSTEPPING], ids=lambda controller: controller.name)
def test_an_absurd_state_never_makes_an_output_that_is_not_finite(controller: AttitudeController) -> None:
    """Finite numbers whose products are not: the loops hold, and recover when the state does."""
    for column, size in itertools.product(range(13), [1e20, 1e100, 1e300]):
        flight = Flight(make(controller), at_rest(), setpoint((0.1, 0.0, 0.0)))
        flight.tick(5)
        flight.state = at_rest()
        flight.state[column] = size
        assert np.isfinite(flight.tick(11)[LoopRow.ROTOR_COMMAND]).all(), (column, size)
        flight.state = at_rest()
        row = flight.tick(50)
        assert np.isfinite(row).all(), (column, size)
        assert not int(row[LoopRow.STATUS]) & HELD, (column, size)


def test_a_setpoint_that_is_not_finite_keeps_the_attitude_target() -> None:
    flight = Flight(make(), at_rest(), setpoint((0.1, 0.0, 0.0)))
    flight.tick(5)
    before = flight.loops.attitude_target.copy()
    flight.wish = setpoint((math.nan, 0.0, 0.0))
    row = flight.tick(5)
    assert flight.loops.attitude_target.tolist() == before.tolist()
    assert row[LoopRow.STATUS] == 0.0


def test_a_controller_that_fails_holds_the_rotors_and_says_so() -> None:
    flight = Flight(make(FAILING), at_rest(), setpoint())
    good = flight.tick(3)
    flight.state = at_rest(rates=(2.0, 0.0, 0.0))
    held = flight.tick(3)
    assert held[LoopRow.STATUS] == LoopStatus.OUTPUT_NOT_FINITE
    assert held[: LoopRow.STATUS].tolist() == good[: LoopRow.STATUS].tolist()
    flight.state = at_rest()
    assert flight.tick()[LoopRow.STATUS] == 0.0


@pytest.mark.parametrize(
    ("state", "wish", "bit"),
    [
        (at_rest(rates=(60.0, 0.0, 0.0)), setpoint(), LoopStatus.ROLL_SATURATED),
        (at_rest(rates=(0.0, 60.0, 0.0)), setpoint(), LoopStatus.PITCH_SATURATED),
        (at_rest(rates=(0.0, 0.0, 60.0)), setpoint(), LoopStatus.YAW_SATURATED),
        (at_rest(rates=(6.0, 0.0, 0.0)), setpoint((0.0, 0.0, -20.0)), LoopStatus.THRUST_SATURATED),
    ],
)
def test_saturation_shows_in_the_status_and_stops_the_integral(state, wish, bit: int) -> None:
    flight = Flight(make(), state, wish)
    row = flight.tick(2)
    assert int(row[LoopRow.STATUS]) & bit
    demanded, achieved = row[LoopRow.WRENCH], row[LoopRow.WRENCH_ACHIEVED]
    axis = {2: 1, 4: 2, 8: 3, 16: 0}[bit]
    assert abs(demanded[axis]) > abs(achieved[axis]) or bit == LoopStatus.THRUST_SATURATED
    assert demanded[axis] != achieved[axis]


def test_integral_of_a_saturated_axis_waits() -> None:
    """Turned by 2 rad about yaw the demand is beyond the rotors, so the integral of yaw stays where it is."""
    flight = Flight(make(), at_rest(), setpoint(yaw=2.0))
    flight.tick(40)
    saturated = [bool(int(row[LoopRow.STATUS]) & LoopStatus.YAW_SATURATED) for row in flight.rows]
    assert any(saturated)
    before = flight.loops.memories["attitude"][2]
    first = saturated.index(True)
    assert all(saturated[first:])
    flight.tick(40)
    assert flight.loops.memories["attitude"][2] == before


def test_row_shows_what_the_rotors_make() -> None:
    flight = Flight(make(), at_rest(rates=(0.2, -0.1, 0.3)), setpoint((0.2, -0.1, -0.3), 0.2))
    row = flight.tick(7)
    speeds = row[LoopRow.ROTOR_COMMAND][:4]
    made = PAPER.effectiveness() @ (speeds * np.abs(speeds))
    assert row[LoopRow.WRENCH_ACHIEVED] == pytest.approx(made, abs=1e-12)
    assert mixer_for(PAPER).high == pytest.approx([303.4359550870504**2] * 4)


def test_an_attitude_given_from_outside_is_flown_in_a_straight_line_over_an_outer_period() -> None:
    """As the outer loop's own targets are; the outer loop rests, and takes over from there without a jump."""
    loops = make()
    flight = Flight(loops, at_rest(), setpoint())
    flight.tick(5)
    integral = loops.outer_memory.copy()
    pitch = 0.2
    target = np.array([math.cos(0.5 * pitch), 0.0, math.sin(0.5 * pitch), 0.0, 0.7 * PAPER.weight_n])
    references, thrusts = [], []
    for period in range(40):
        loops.set_attitude_target(target)
        for _ in range(5):
            row = np.zeros(LoopRow.SIZE)
            loops.step(flight.state, flight.wish, SPEEDS, False, row)
            references.append(row[LoopRow.REFERENCE_ATTITUDE][2])
            thrusts.append(row[LoopRow.WRENCH][0])
        assert period or loops.fraction == pytest.approx(1.0)
    assert thrusts == pytest.approx([0.7 * PAPER.weight_n] * 200)
    assert references[-1] == pytest.approx(math.sin(0.5 * pitch), rel=1e-3)
    steps = np.diff(references)
    assert steps.min() >= -1e-9  # it comes from one side
    assert np.abs(np.diff(steps)).max() < 1e-3
    assert loops.outer_memory.tolist() == integral.tolist()
    before = loops.attitude_target.copy()
    row = np.zeros(LoopRow.SIZE)
    loops.step(flight.state, flight.wish, SPEEDS, True, row)
    assert loops.memory[0]["last_target"].tolist() == before.tolist()  # the way back begins here


def rate_damping(
    memory: NoMemory, inputs: AttitudeInputs, params: NoParams, dt_s: float
) -> tuple[NoMemory, Vector3]:
    """A law that does not look at the reference."""
    return memory, Vector3(-0.01 * inputs.rates_frd_rad_s.x, 0.0, 0.0)


def test_a_reference_that_is_not_finite_is_not_kept_by_a_law_that_ignores_it() -> None:
    law = ControlLaw(
        "damping",
        compiled(rate_damping),
        NoMemory,
        NoParams,
        (0.0,),
        lambda vehicle, gains: NoParams(0.0),
        (),
    )
    flight = Flight(make(law), at_rest(), setpoint())
    flight.tick(3)
    flight.loops.memory[0]["reference_params"][3] = 1e308  # its largest acceleration
    flight.loops.memory[0]["reference_params"][0] = 1e200  # and bandwidth
    flight.state = at_rest(rates=(0.1, 0.0, 0.0))
    flight.loops.set_attitude_target(np.array([0.0, 1.0, 0.0, 0.0, 4.0]))
    held = flight.tick()
    assert held[LoopRow.STATUS] == LoopStatus.OUTPUT_NOT_FINITE
    assert np.isfinite(flight.loops.memory[0]["reference"]).all()
