"""Desired trajectories: their derivatives, their files, and what a bad file is told."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from flightstack.core.errors import ConfigError
from gcs_cli.experiments.paper.flights.trajectory import (
    ATTITUDE,
    MODEL_M_S2,
    MODEL_RAD_S,
    POSITION,
    Move,
    Trajectory,
    load_trajectory,
    sample,
    setpoints,
    shaped_setpoints,
    trajectory_names,
)

SMOOTH_SHAPES = ("smooth", "sine", "cosine")


def one_move(shape: str, cycles: float = 1.0) -> Trajectory:
    return Trajectory("one", "", POSITION, 5.0, (Move("east", shape, 1.0, 3.0, 2.0, cycles),))


@pytest.mark.parametrize("shape", SMOOTH_SHAPES)
def test_rate_and_acceleration_are_the_derivatives(shape: str) -> None:
    step = 1e-4
    time_s = np.arange(0.0, 5.0, step)
    at = sample(one_move(shape, 1.5), time_s)
    middle = slice(1, -1)
    rate = (at.value[2:] - at.value[:-2]) / (2.0 * step)
    acceleration = (at.value[2:] - 2.0 * at.value[1:-1] + at.value[:-2]) / step**2
    assert np.abs(rate - at.rate[middle]).max() < 1e-5 * np.abs(at.rate).max()
    # the acceleration of the least jerk has kinks at its ends, where a difference quotient is off by a step of the jerk
    assert np.abs(acceleration - at.acceleration[middle]).max() < 1e-3 * np.abs(at.acceleration).max()
    assert np.abs(at.rate[:, 1]).max() > 0.5


@pytest.mark.parametrize("shape", SMOOTH_SHAPES)
def test_smooth_moves_begin_and_end_at_rest(shape: str) -> None:
    at = sample(one_move(shape), np.array([0.0, 1.0, 4.0, 5.0]))
    assert at.rate == pytest.approx(np.zeros((4, 4)), abs=1e-12)
    assert at.acceleration == pytest.approx(np.zeros((4, 4)), abs=1e-9)
    end = 2.0 if shape == "smooth" else 0.0
    assert at.value[:, 1] == pytest.approx([0.0, 0.0, end, end], abs=1e-12)


def test_sine_and_cosine_make_a_circle() -> None:
    moves = (Move("north", "sine", 0.0, 4.0, 1.5), Move("east", "cosine", 0.0, 4.0, 1.5))
    at = sample(Trajectory("circle", "", POSITION, 4.0, moves), np.linspace(0.0, 4.0, 401))
    assert np.hypot(at.value[:, 0], at.value[:, 1] - 1.5) == pytest.approx(np.full(401, 1.5), abs=1e-12)


def test_a_step_jumps_at_its_time_and_has_no_rate() -> None:
    trajectory = Trajectory("step", "", POSITION, 5.0, (Move("yaw", "step", 2.0, 0.0, 0.7),))
    at = sample(trajectory, np.array([1.999, 2.0, 5.0]))
    assert at.value[:, 3].tolist() == [0.0, 0.7, 0.7]
    assert not at.rate.any()


def test_a_ramp_has_one_rate() -> None:
    at = sample(one_move("ramp"), np.array([0.5, 1.0, 2.5, 4.0, 4.5]))
    assert at.value[:, 1] == pytest.approx([0.0, 0.0, 1.0, 2.0, 2.0])
    assert at.rate[:, 1] == pytest.approx([0.0, 2.0 / 3.0, 2.0 / 3.0, 0.0, 0.0])


def test_moves_that_overlap_add_up_and_scale() -> None:
    moves = (Move("north", "smooth", 0.0, 2.0, 1.0), Move("north", "ramp", 1.0, 2.0, -0.5))
    both = sample(Trajectory("both", "", POSITION, 4.0, moves), np.linspace(0.0, 4.0, 41), 3.0)
    apart = [
        sample(Trajectory("one", "", POSITION, 4.0, (move,)), np.linspace(0.0, 4.0, 41)) for move in moves
    ]
    assert both.value == pytest.approx(3.0 * (apart[0].value + apart[1].value))


def test_setpoints_hold_position_heading_and_their_rates() -> None:
    trajectory = load_trajectory("desired")
    time_s = np.arange(0.0, trajectory.duration_s, 0.01)
    rows, at = setpoints(trajectory, time_s), sample(trajectory, time_s)
    assert (rows[:, 0:3] == at.value[:, :3]).all()
    assert (rows[:, 3:6] == at.rate[:, :3]).all()
    assert (rows[:, 6:9] == at.acceleration[:, :3]).all()
    assert (rows[:, 9] == at.value[:, 3]).all()
    assert (rows[:, 10] == at.rate[:, 3]).all()


@pytest.mark.parametrize("name", trajectory_names())
def test_trajectories_of_the_package_end_in_a_rest(name: str) -> None:
    trajectory = load_trajectory(name)
    assert trajectory.description
    at = sample(trajectory, np.linspace(trajectory.duration_s - 2.0, trajectory.duration_s, 201))
    assert np.ptp(at.value, axis=0) == pytest.approx(np.zeros(len(trajectory.axes)), abs=1e-12)
    assert trajectory.kind == (ATTITUDE if name in ("step_roll", "step_pitch", "step_yaw") else POSITION)


def test_the_desired_trajectory_moves_all_four_commands_and_comes_back() -> None:
    trajectory = load_trajectory("desired")
    at = sample(trajectory, np.linspace(0.0, trajectory.duration_s, 3401))
    assert (np.ptp(at.value, axis=0) > 1.0).all()
    assert at.value[-1] == pytest.approx([0.0, 0.0, -0.5, 0.0], abs=1e-9)
    assert np.linalg.norm(at.acceleration[:, :2], axis=1).max() == pytest.approx(1.92, abs=0.005)
    assert np.abs(at.acceleration[:, 2]).max() == pytest.approx(0.72, abs=0.005)


def test_the_reference_model_makes_of_a_step_a_path_that_can_be_flown() -> None:
    time_s = np.arange(0.0, 9.0, 0.004)
    rows = shaped_setpoints(load_trajectory("step_x"), time_s)
    t = np.maximum(time_s - 1.0, 0.0)
    free = 1.0 - (1.0 + MODEL_RAD_S * t) * np.exp(-MODEL_RAD_S * t)  # where it asks for less than it may
    small = shaped_setpoints(load_trajectory("step_x"), time_s, scale=0.1)
    assert small[:, 0] == pytest.approx(0.1 * free, abs=0.0015)
    assert np.abs(rows[:, 6]).max() == MODEL_M_S2
    assert rows[:, 0].max() <= 1.0 + 1e-9
    assert rows[-1, 0] == pytest.approx(1.0, abs=1e-6)
    assert np.diff(rows[:, 0]) == pytest.approx(0.004 * rows[1:, 3], abs=1e-12)
    assert np.diff(rows[:, 3]) == pytest.approx(0.004 * rows[:-1, 6], abs=1e-12)


def test_the_reference_model_bounds_a_diagonal_and_leaves_the_heading() -> None:
    time_s = np.arange(0.0, 22.0, 0.004)
    bare, shaped = (shape(load_trajectory("hard"), time_s, 2.0) for shape in (setpoints, shaped_setpoints))
    assert np.linalg.norm(shaped[:, 6:8], axis=1).max() == pytest.approx(MODEL_M_S2)
    assert np.abs(shaped[:, 8]).max() <= MODEL_M_S2
    assert (shaped[:, 9:] == bare[:, 9:]).all()


BAD = {
    "no such shape": ('[[move]]\nshape = "spiral"\nat_s = 1.0\n', "move[0].shape: 'spiral' is not one of"),
    "an axis of the other kind": (
        '[[move]]\nshape = "step"\nat_s = 1.0\nroll_deg = 3.0\n',
        "move[0].roll_deg: is not a known key",
    ),
    "no duration of a ramp": (
        '[[move]]\nshape = "ramp"\nat_s = 1.0\nup_m = 1.0\n',
        "move[0].over_s: is missing",
    ),
    "not a number": ('[[move]]\nshape = "step"\nat_s = nan\nup_m = 1.0\n', "move[0].at_s: nan is outside"),
    "no moves": ("", "move: is missing"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_named_with_its_key(name: str, tmp_path: Path) -> None:
    text, problem = BAD[name]
    path = tmp_path / "mine.toml"
    path.write_text(f'description = "mine"\nkind = "position"\nduration_s = 5.0\n{text}')
    with pytest.raises(ConfigError) as raised:
        load_trajectory(str(path))
    assert problem in str(raised.value)


def test_up_is_negative_down_and_degrees_are_radians(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(
        'description = "mine"\nkind = "position"\nduration_s = 5.0\n'
        '[[move]]\nshape = "step"\nat_s = 1.0\nup_m = 2.0\nyaw_deg = 90.0\n'
    )
    at = sample(load_trajectory(str(path)), np.array([2.0]))
    assert at.value[0].tolist() == [0.0, 0.0, -2.0, math.radians(90.0)]


def test_an_unknown_name_lists_the_known_ones() -> None:
    with pytest.raises(ConfigError, match="desired, hard, smooth"):
        load_trajectory("spiral")
