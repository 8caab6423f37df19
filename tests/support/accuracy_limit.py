"""Errors of the filter in flight beside those of the batch smoother, the accuracy limit of its sensors.

``python -m tests.support.accuracy_limit [--flights N] [--seed S]`` prints the table of docs/explanation/estimator.md.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from flightstack.core.contract import FloatArray
from flightstack.core.geodesy import GeoPoint, LocalFrame
from flightstack.params.vehicle import Vehicle, load_vehicle
from flightstack.testing import World
from gcs_cli.estimate.track import Track, differences, errors_at, flight_span, logged_track
from gcs_cli.logs.ulog_reader import read_ulog
from tests.support.batch_smoother import SIZE, Noise, Solution, States, covariance, smoothed
from tests.support.preintegration import POSITION, TURN, VELOCITY, Flight
from tests.support.smoothed_flight import measurements, noise_of

QUANTITIES = (
    "tilt [°]",
    "yaw [°]",
    "horizontal velocity [m/s]",
    "vertical velocity [m/s]",
    "horizontal position [m]",
    "altitude [m]",
    "height above the start [m]",
)
_VEHICLE = "x_quad"
_ENDS = 4
"""Moments of a flight at which the best filter is judged."""
_ROUNDING_S = 1e-6


class Limit(NamedTuple):
    """Mean squared errors of a flight by ``QUANTITIES``, each of shape (7,)."""

    filter: FloatArray
    smoother: FloatArray
    best_filter: FloatArray
    """Of the smoother at the last of its measurements, without later ones, at a few moments."""
    filter_then: FloatArray
    """Of the filter at these moments."""
    residuals: FloatArray
    """Mean square of the smoother's residuals, 1 if its model is that of the sensors, shape (1,)."""
    claimed: FloatArray
    """NEES of its attitude, velocity and position in the middle of the flight, 1 in the mean, shape (3,)."""


def _hover(world: World) -> None:
    world.run_for(20.0)


def _square(world: World) -> None:
    for north_m, east_m in ((6.0, 0.0), (6.0, 6.0), (0.0, 6.0), (0.0, 0.0)):
        world.goto(north_m, east_m)
        world.run_for(6.0)


ROUTES: Mapping[str, Callable[[World], None]] = {"hover": _hover, "square": _square}


def fly(route: str, seed: int, *, with_best: bool = False) -> Limit:
    """Fly ``x_quad`` on its sensors from rest; judge the filter by the log."""
    with World(vehicle=_VEHICLE, state="estimated", seed=seed) as world:
        world.wait_until_ready()
        world.arm()
        world.run_for(3.0)
        world.takeoff(5.0)
        world.run_for(6.0)
        ROUTES[route](world)
        return _limit(world.engine.newest_log(), load_vehicle(_VEHICLE), world.setup.home, with_best)


class _States(NamedTuple):
    """Attitudes (k, 3, 3), other states (k, 16), and what the smoother takes for the down position of the start."""

    attitude: FloatArray
    others: FloatArray
    start_down_m: FloatArray


class _Estimated(NamedTuple):
    """An estimate over time, and what it takes for the down position of the start, which it may learn later."""

    track: Track
    start_down_m: FloatArray


def _limit(content: bytes, vehicle: Vehicle, home: GeoPoint, with_best: bool) -> Limit:
    log = read_ulog(content, "flight")
    latency_s = vehicle.sensors.numbers["gnss"]["latency_s"]
    assert isinstance(latency_s, float)
    flight, at = measurements(log, home, latency_s)
    noise = noise_of(vehicle.sensors, flight.step_s, float(at[-1] - at[0]))
    own, truth = logged_track(log), logged_track(log, "_groundtruth")
    assert own is not None
    assert truth is not None
    assert truth.origin is not None
    # the log counts true heights from the ground at home
    truth = replace(truth, origin=truth.origin._replace(altitude_m=home.altitude_m))
    span = flight_span(truth)
    assert span is not None
    squares = partial(_squares, truth=truth, begin_s=span[0], end_s=float(at[-1]) + _ROUNDING_S)
    solution = smoothed(flight, noise)
    whole = solution.states
    best = then = np.full(len(QUANTITIES), np.nan)
    if with_best:
        ends = np.linspace(np.searchsorted(at, span[0] + 4.0), len(at) - 1, _ENDS).astype(int)
        best = squares(_estimated(_best_filter(flight, noise, whole, ends), at[ends], home))
        then = squares(_filter(_nearest(own, at[ends])))
    start = np.full(len(at), whole.others[0, 5])
    smoother = _estimated(_States(whole.attitude, whole.others, start), at, home)
    residuals = np.array([solution.squares / solution.freedom])
    claimed = _claimed(solution, smoother.track, truth, len(at) // 2)
    return Limit(squares(_filter(own)), squares(smoother), best, then, residuals, claimed)


def _claimed(solution: Solution, track: Track, truth: Track, keyframe: int) -> FloatArray:
    """Return the squared errors of a keyframe over the variances that the smoother states, shape (3,)."""
    errors = errors_at(track, truth)[keyframe]
    errors[TURN] = errors[TURN] @ solution.states.attitude[keyframe]  # from NED to the body frame
    stated = covariance(solution, keyframe * SIZE)
    parts = (TURN, VELOCITY, POSITION)
    return np.array(
        [errors[part] @ np.linalg.solve(stated[part, part], errors[part]) / 3.0 for part in parts]
    )


def _squares(estimated: _Estimated, truth: Track, begin_s: float, end_s: float) -> FloatArray:
    """Return the mean squared errors by ``QUANTITIES``, shape (7,)."""
    track, start = estimated
    assert track.origin is not None
    assert truth.origin is not None
    found = differences(track, truth, begin_s, end_s)
    velocity, position = np.square(found.velocity_m_s), found.position_m
    start = start[np.searchsorted(track.motion_s, found.motion_s - _ROUNDING_S)]
    height = position[:, 2] - start - LocalFrame(truth.origin).to_ned(track.origin).z
    errors = (
        np.square(found.tilt_deg),
        np.square(found.yaw_deg),
        velocity[:, 0] + velocity[:, 1],
        velocity[:, 2],
        np.square(position[:, 0]) + np.square(position[:, 1]),
        np.square(position[:, 2]),
        np.square(height),
    )
    return np.array([np.mean(values) for values in errors])


def _filter(track: Track) -> _Estimated:
    """Return the filter's estimate, which starts at zero."""
    return _Estimated(track, np.zeros(len(track.motion_s)))


def _estimated(states: _States, times_s: FloatArray, home: GeoPoint) -> _Estimated:
    """Return states of the smoother as those of a log."""
    x, y, z, w = Rotation.from_matrix(states.attitude).as_quat().T
    turns, others = np.column_stack([w, x, y, z]), states.others
    signs = np.where(np.sum(turns[1:] * turns[:-1], axis=1) < 0.0, -1.0, 1.0)
    turns = turns * np.concatenate([[1.0], np.cumprod(signs)])[:, None]
    track = Track(times_s, turns, times_s, others[:, :3], others[:, 3:6], home)
    return _Estimated(track, states.start_down_m)


def _best_filter(flight: Flight, noise: Noise, whole: States, ends: FloatArray) -> _States:
    """Return the last states of the smoother for the measurements up to each of the keyframes ``ends``."""
    found = []
    for end in ends.tolist():
        guess = States(whole.attitude[: end + 1], whole.others[: end + 1], whole.constants)
        found.append(smoothed(_until(flight, end), noise, guess).states)
    attitude = np.array([states.attitude[-1] for states in found])
    others = np.array([states.others[-1] for states in found])
    start = np.array([states.others[0, 5] for states in found])
    return _States(attitude, others, start)


def _nearest(track: Track, times_s: FloatArray) -> Track:
    """Return the samples of a track that are nearest to these times."""
    turns, motions = (
        np.abs(of[:, None] - times_s).argmin(axis=0) for of in (track.attitude_s, track.motion_s)
    )
    return Track(
        track.attitude_s[turns],
        track.attitude[turns],
        track.motion_s[motions],
        track.velocity_m_s[motions],
        track.position_m[motions],
        track.origin,
    )


def _until(flight: Flight, end: int) -> Flight:
    """Return the measurements up to a keyframe."""
    intervals = {
        name: getattr(flight, name)[:end] for name in ("gyro", "accel", "mag", "current", "altitude")
    }
    keyframes = {
        name: getattr(flight, name)[: end + 1] for name in ("gnss_position", "gnss_velocity", "is_rest")
    }
    return flight._replace(**intervals, **keyframes)


def rms(limits: list[Limit]) -> Limit:
    """Return root mean squares over flights."""
    return Limit(*(np.sqrt(np.mean(np.array(column), axis=0)) for column in zip(*limits, strict=True)))


def main() -> None:
    """Fly and print the table in Markdown."""
    parser = argparse.ArgumentParser(prog="python -m tests.support.accuracy_limit", description=__doc__)
    parser.add_argument("--flights", type=int, default=16, help="of each route")
    parser.add_argument("--seed", type=int, default=101, help="seed of the first flight")
    options = parser.parse_args()
    print(
        "| route | error | filter | smoother | ratio | best filter | ratio |\n|---|---|---|---|---|---|---|"
    )
    for route in ROUTES:
        flights = [fly(route, options.seed + number, with_best=True) for number in range(options.flights)]
        own, limit, best, then, residuals, claimed = rms(flights)
        for name, *row in zip(QUANTITIES, own, limit, own / limit, best, then / best, strict=True):
            cells = [f"{value:.{digits}f}" for value, digits in zip(row, (3, 3, 1, 3, 1), strict=True)]
            print(f"| {route} | {name} | {' | '.join(cells)} |")
        attitude, velocity, position = np.square(claimed)
        print(f"{route}: mean square of the smoother's residuals {residuals[0] ** 2:.2f}")
        print(f"{route}: its NEES {attitude:.2f} attitude, {velocity:.2f} velocity, {position:.2f} position")


if __name__ == "__main__":
    main()
