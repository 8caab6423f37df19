"""Cases flown in one process: the flying stack's computations bit for bit, and what comes out of the paper's cases."""

from __future__ import annotations

import math

import numpy as np
import pytest

from flightstack.core.contract import LoopRow, LoopStatus, Vector3
from flightstack.flight_log.flight_log import FlightLog
from flightstack.params.config import TRUTH, StackConfig
from flightstack.params.gains_file import open_gains
from flightstack.params.vehicle import load_vehicle
from flightstack.process.assembly import build
from flightstack.simulator_link.hot_frames import ActuatorsFrame
from gcs_cli.experiments.paper.findings.comparisons import shared_overshoots
from gcs_cli.experiments.paper.findings.plants import ROUNDING_M, difference
from gcs_cli.experiments.paper.flights import closed_loop
from gcs_cli.experiments.paper.flights.cases import (
    BACKSTEPPING,
    CONDITIONS,
    CONTENDERS,
    NUDGE,
    PID,
    POLES,
    RATE_FED_PID,
    make_case,
)
from gcs_cli.experiments.paper.flights.closed_loop import fly, fly_rows, hover_speeds
from gcs_cli.experiments.paper.flights.experiments import entry_of
from gcs_cli.experiments.paper.flights.metrics import measure, path_metrics
from gcs_cli.experiments.paper.flights.trajectory import Move, Trajectory, load_trajectory, setpoints
from gcs_cli.experiments.paper.flights.types import Case, Recording
from sim_bridge.plant.disturbance import Disturbance
from sim_bridge.plant.plant import PlantOptions
from sim_bridge.simulator import Simulator

PLANTS = ("paper", "rigid")
BY_NAME = {contender.name: contender for contender in CONTENDERS}
CONDITION = {condition.name: condition for condition in CONDITIONS}


def no_log() -> FlightLog:
    raise AssertionError("nothing arms here")


def rows_over_the_links(case: Case, trajectory: Trajectory) -> np.ndarray:
    """Fly the case with the stack's own loops and the simulator, exchanging the frames of the lockstep."""
    config = StackConfig(
        vehicle=case.vehicle,
        controller=case.controller,
        gains=case.gains,
        inner_hz=case.inner_hz,
        outer_hz=case.outer_hz,
        ideal_rotors=not case.limits,
        state=TRUTH,
    )
    stack = build(config, no_log)
    options = PlantOptions(
        disturbance=Disturbance(force_ned_n=case.force_ned_n), ground=False, limits=case.limits, battery=None
    )
    simulator = Simulator(stack.vehicle, case.plant, options)
    simulator.set_interval_us(stack.rates.interval_us)
    simulator.plant.set_rotor_speeds(hover_speeds(case))
    simulator.plant.show()
    link, actuators = stack.simulator, ActuatorsFrame()
    assert link.receive(memoryview(simulator.outgoing()))
    stack.loops.reset(link.state)
    count = round(trajectory.duration_s * case.inner_hz)
    wanted = setpoints(trajectory, np.arange(count) / case.inner_hz)
    rows = np.zeros((count, LoopRow.SIZE))
    for tick in range(count):
        due = tick % stack.rates.divisor == 0
        stack.loops.step(link.state, wanted[tick], link.rotor_speed_rad_s, due, rows[tick])
        assert actuators.open(link.answer(rows[tick, LoopRow.ROTOR_COMMAND], True))
        simulator.apply(actuators)
        assert link.receive(memoryview(simulator.outgoing()))
    return rows


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("controller", ["pid", "backstepping"])
def test_a_case_is_the_flight_over_the_links_bit_for_bit(plant: str, controller: str) -> None:
    trajectory = load_trajectory("hard")._replace(duration_s=4.6)  # four steps, with saturated rotors
    case = Case("a", "hard", controller=controller, plant=plant, force_ned_n=Vector3(0.2, 0.1, 0.0))
    rows = fly_rows(case, trajectory)
    assert not rows.diverged
    assert (rows.loops[:, LoopRow.STATUS] != 0.0).any()
    assert rows.loops.tobytes() == rows_over_the_links(case, trajectory).tobytes()


def test_a_case_without_limits_is_the_flight_with_ideal_rotors() -> None:
    trajectory = load_trajectory("hard")._replace(duration_s=4.6)
    case = Case("a", "hard", limits=False, lag_s=0.0)
    over_the_links = rows_over_the_links(case, trajectory)
    assert fly_rows(case, trajectory).loops.tobytes() == over_the_links.tobytes()
    assert (
        over_the_links[:, LoopRow.ROTOR_COMMAND].max()
        > 1.1 * load_vehicle("paper_quad").rotors[0].max_speed_rad_s
    )


def test_the_same_case_gives_the_same_bits() -> None:
    case = make_case(BY_NAME[BACKSTEPPING], "step_x", CONDITION["torque"], "rigid")
    one, other = fly(case), fly(case)
    for name, value in one._asdict().items():
        if isinstance(value, np.ndarray):
            assert value.tobytes() == getattr(other, name).tobytes(), name
    assert len(one.time_s) == 9000


@pytest.mark.parametrize("plant", PLANTS)
def test_hover_is_where_a_flight_begins(plant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    still = Trajectory("still", "", "position", 1.0, (Move("north", "step", 0.9, 0.0, 0.0),))
    monkeypatch.setattr(closed_loop, "load_trajectory", lambda name: still)
    flight = fly(Case("a", "still", controller="backstepping", plant=plant))
    assert np.abs(flight.position_ned_m).max() < 1e-9
    assert np.abs(flight.rotor_speed_rad_s - hover_speeds(flight.case)).max() < 1e-3
    assert not flight.status.any()


def test_attitude_steps_reach_the_inner_loop_without_the_outer_one() -> None:
    flight = fly(Case("a", "step_roll"))
    assert np.isnan(flight.reference[:, :3]).all()
    assert flight.euler_target_rad[-1] == pytest.approx([math.radians(5.0), 0.0, 0.0], abs=1e-12)
    assert flight.euler_rad[-1, 0] == pytest.approx(math.radians(5.0), abs=1e-3)
    assert flight.velocity_ned_m_s[-1, 1] > 2.0  # nobody holds the position
    assert abs(flight.velocity_ned_m_s[-1, 2]) < 0.1  # and thrust carries the weight


def test_the_scale_makes_a_trajectory_small() -> None:
    flight = fly(Case("a", "step_pitch", scale=0.01))
    assert flight.euler_target_rad[-1, 1] == pytest.approx(math.radians(0.05))


def test_the_plant_is_heavier_than_the_loops_know() -> None:
    """A PD sinks until its error carries what the weight fed forward does not: Δm g over Kp_z b."""
    flight = fly(Case("a", "step_x", mass_factor=1.2))
    sag_m = 0.2 * 0.55 * 9.81 / (2.83e5 * 2.93e-5)
    # thrust is for the nominal mass times the error's acceleration, so the error carries it alone
    assert measure(flight)["z"].steady_state_error == pytest.approx(sag_m, rel=0.01)


def test_a_force_pushes_a_pd_aside() -> None:
    flight = fly(Case("a", "step_y", force_ned_n=Vector3(0.5, 0.0, 0.0)))
    assert measure(flight)["x"].steady_state_error == pytest.approx(0.5 / 0.55 / 10.0, rel=0.02)


def test_delay_steps_delay_the_actuators() -> None:
    trajectory = load_trajectory("step_roll")._replace(duration_s=0.55)
    prompt, late = (
        fly_rows(Case("a", "step_roll", lag_s=0.0, delay_steps=steps), trajectory).loops for steps in (0, 3)
    )
    speed, command = LoopRow.ROTOR_SPEED, LoopRow.ROTOR_COMMAND
    assert late[103:550, speed][:, :4] == pytest.approx(late[99:546, command][:, :4], rel=1e-6)
    assert prompt[100:550, speed][:, :4] == pytest.approx(prompt[99:549, command][:, :4], rel=1e-6)


def test_a_crash_ends_the_recording_and_says_why() -> None:
    flight = fly(make_case(BY_NAME[PID], "hard", CONDITION["lag_20"], "paper"))
    assert flight.ended_s is not None
    assert flight.ended_why in ("turned over", "10 m away from its reference")
    assert len(flight.time_s) == round(flight.ended_s * 1000)
    assert np.isfinite(flight.position_ned_m).all()


def test_numbers_that_run_away_end_the_recording() -> None:
    flight = fly(Case("a", "step_roll", force_ned_n=Vector3(1e308, 0.0, 0.0)))
    assert flight.ended_s is not None
    assert flight.ended_s < 1.0
    assert flight.ended_why == "the numbers of the plant ran away"


def test_rates_that_do_not_divide_are_refused() -> None:
    with pytest.raises(ValueError, match="does not divide"):
        fly(Case("a", "step_roll", inner_hz=1000, outer_hz=300))


def test_the_linear_pd_has_the_poles_of_backstepping() -> None:
    c = open_gains("paper").table("attitude_backstepping").numbers("c", 6, 0.0, 1e4)
    pd = open_gains("backstepping_poles").table("attitude_pid")
    kp, kd = pd.numbers("kp", 3, 0.0, 1e5), pd.numbers("kd", 3, 0.0, 1e5)
    for axis in range(3):
        first, second = c[2 * axis], c[2 * axis + 1]
        assert kp[axis] == pytest.approx(1.0 + first * second, rel=1e-12)
        assert kd[axis] == pytest.approx(first + second, rel=1e-12)


# ---------------------------------------------------------------- what the comparison of the controllers finds


def flown(
    contender: str, trajectory: str, condition: str = "plain", plant: str = "paper", push_n: float = 0.0
) -> Recording:
    """Fly a case. ``push_n`` moves an unstable loop from its rest, which takes rounding a time that is chance."""
    case = make_case(BY_NAME[contender], trajectory, CONDITION[condition], plant)
    return fly(case._replace(force_ned_n=Vector3(push_n, -push_n, 0.0)) if push_n else case)


def worst_overshoot(recording: Recording) -> float:
    figures = measure(recording)
    return max(figures[axis].overshoot_percent or 0.0 for axis in ("x", "y"))


def xy_rms_m(recording: Recording) -> float:
    path = path_metrics(recording)
    assert path is not None
    return path.rms_error_m


@pytest.mark.parametrize("plant", PLANTS)
def test_a_linear_pd_with_its_poles_flies_as_backstepping_does(plant: str) -> None:
    for trajectory in ("smooth", "hard"):
        backstepping, poles = (flown(name, trajectory, plant=plant) for name in (BACKSTEPPING, POLES))
        assert xy_rms_m(poles) == pytest.approx(xy_rms_m(backstepping), rel=0.01)
    assert worst_overshoot(poles) == pytest.approx(worst_overshoot(backstepping), abs=1.0)


@pytest.mark.parametrize("plant", PLANTS)
def test_backstepping_overshoots_less_than_a_pd_without_the_rate_alone(plant: str) -> None:
    """What Table III has and Table II has not is the rate of the reference: with it the PD overshoots no more."""
    names = PID, RATE_FED_PID, BACKSTEPPING
    found = [entry_of(flown(name, "hard", plant=plant, push_n=1e-12)) for name in names]
    over = shared_overshoots(found)
    assert over is not None
    without, fed, backstepping = over.median_percent
    assert backstepping < without - 3.0
    assert fed < backstepping + 1.0


def test_a_reference_model_takes_the_overshoot_from_everybody() -> None:
    for name in (PID, BACKSTEPPING, "tuned_pid"):
        bare, shaped = (
            worst_overshoot(flown(name, "step_x", condition)) for condition in ("plain", "shaped")
        )
        assert bare > 15.0
        assert shaped < 2.0


def test_without_limits_the_spin_up_torque_ends_the_papers_pid() -> None:
    """Its yaw loop is unstable there, and nothing but the rotors' limits bounds what it asks for."""
    flight = flown(PID, "hard", "no_limits", "rigid", push_n=1e-12)
    assert flight.ended_how == "lost"
    assert flight.ended_s is not None
    assert flight.ended_s < 1.0  # measured 0.54 to 0.56 with pushes of 1e-12 N


def test_smooth_paths_are_flown_alike_on_the_papers_model() -> None:
    pid, backstepping = (flown(name, "smooth") for name in (PID, BACKSTEPPING))
    assert xy_rms_m(backstepping) == pytest.approx(xy_rms_m(pid), rel=0.1)
    assert not pid.status.any()
    assert not backstepping.status.any()


@pytest.mark.parametrize("plant", PLANTS)
def test_backstepping_is_worse_against_a_constant_torque(plant: str) -> None:
    """Its stiffness in pitch is a seventh of the PD's."""
    pid, backstepping = (measure(flown(name, "step_x", "torque", plant)) for name in (PID, BACKSTEPPING))
    assert abs(backstepping["x"].steady_state_error) > 5.0 * abs(pid["x"].steady_state_error)


def test_the_papers_gains_do_not_survive_motors_of_20_ms() -> None:
    for name in (PID, BACKSTEPPING):
        assert flown(name, "hard", "lag_20").ended_s is not None
    assert flown("tuned_pid", "hard", "lag_20").ended_s is None


def test_the_torque_that_spins_the_rotors_up_shakes_the_papers_yaw_loop() -> None:
    """What the paper leaves out, J_r Ω̇, is forty times the rotors' drag at 5 ms: Table II's yaw loop does not rest."""
    left_out, there = (flown(PID, "step_x", plant=plant) for plant in PLANTS)
    late = left_out.time_s > 7.0
    saturated = LoopStatus.YAW_SATURATED
    assert not (left_out.status[late] & saturated).any()
    assert ((there.status[late] & saturated) != 0).mean() > 0.5
    assert not flown(BACKSTEPPING, "step_x", plant="rigid").status[late].any()


@pytest.mark.parametrize("trajectory", ["desired", "hard", "step_yaw"])
def test_rigid_body_and_multibody_fly_alike(trajectory: str) -> None:
    """Where no loop amplifies rounding, within nanometres."""
    pytest.importorskip("mujoco")
    rigid, multibody = (flown(BACKSTEPPING, trajectory, plant=plant) for plant in ("rigid", "multibody"))
    found = difference(rigid, multibody)
    assert found["both_flew_to_the_end"]
    assert found["max_position_m"] < 1e-9
    assert found["max_attitude_deg"] < 1e-6
    assert rigid.position_ned_m.tobytes() != multibody.position_ned_m.tobytes()  # they are two plants


def test_a_push_of_nothing_stays_nothing_where_the_loops_are_stable() -> None:
    """The PID of Table II is not, in yaw, on a body that feels its rotors spin up: there no bound between two plants
    tells anything, since one plant comes as far apart from itself."""
    moved_m = {}
    for name in (PID, BACKSTEPPING):
        plain = flown(name, "desired", plant="rigid")
        nudged = fly(make_case(BY_NAME[name], "desired", NUDGE, "rigid"))
        moved_m[name] = difference(plain, nudged)["max_position_m"]
    assert moved_m[BACKSTEPPING] < 1e-9
    assert moved_m[PID] > ROUNDING_M


def test_the_papers_gains_ask_for_more_than_a_motor_of_that_size_gives() -> None:
    """0.2 N m is six times what hover takes; rotors of Table I's inertia then follow in tens of milliseconds."""
    for name in (PID, BACKSTEPPING):
        assert flown(name, "hard", "drive", "rigid").ended_how == "crashed"
    assert flown("tuned_pid", "hard", "drive", "rigid").ended_s is None
