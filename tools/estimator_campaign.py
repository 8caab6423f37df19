"""Fly seeded flights on sensors and examine the estimator's consistency: NEES of each state, NIS of each sensor.

``python -m tools.estimator_campaign --flights 200`` flies hover, square and lemniscate in wind by turns, with another
seed each. The error of a state by its covariance is read once a flight, at its end, so that the flights are
independent; then its mean lies between the 95 % bounds of the chi-square distribution if the filter is consistent.
Innovations are averaged over a flight.
"""

from __future__ import annotations

import argparse
import itertools
import json
import math
import os
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from typing import Any, NamedTuple

import numpy as np
from scipy import stats

from flightstack.core.contract import FloatArray, Quaternion
from flightstack.core.geodesy import LocalFrame
from flightstack.core.geometry import conjugate, quaternion_product, rotation_vector
from flightstack.estimation.error_state import ACCEL_BIAS, ATTITUDE, GYRO_BIAS, POSITION, VELOCITY
from flightstack.estimation.kalman import BARO, GNSS_POSITION, GNSS_VELOCITY, MAG, symmetric
from flightstack.testing import World

STATES: Mapping[str, tuple[int, ...]] = {
    "tilt": (ATTITUDE, ATTITUDE + 1),
    "yaw": (ATTITUDE + 2,),
    "velocity, horizontal": (VELOCITY, VELOCITY + 1),
    "velocity, vertical": (VELOCITY + 2,),
    "position, horizontal": (POSITION, POSITION + 1),
    "position, vertical": (POSITION + 2,),
    "gyro bias": (GYRO_BIAS, GYRO_BIAS + 1, GYRO_BIAS + 2),
    "accelerometer bias": (ACCEL_BIAS, ACCEL_BIAS + 1, ACCEL_BIAS + 2),
}
SENSORS: Mapping[str, tuple[int, ...]] = {
    "GNSS velocity, horizontal": (GNSS_VELOCITY, GNSS_VELOCITY + 1),
    "GNSS velocity, vertical": (GNSS_VELOCITY + 2,),
    "GNSS position, horizontal": (GNSS_POSITION, GNSS_POSITION + 1),
    "GNSS position, vertical": (GNSS_POSITION + 2,),
    "magnetometer": (MAG, MAG + 1, MAG + 2),
    "barometer": (BARO,),
}
FLIGHT_S, CLIMB_S = 30.0, 8.0
_PARTS = ACCEL_BIAS + 3


class Consistency(NamedTuple):
    """Mean of normalised squares, 1 for a consistent filter, with the 95 % bounds for it."""

    mean: float
    low: float
    high: float


def _hover(world: World) -> None:
    world.run_for(FLIGHT_S)


def _square(world: World) -> None:
    for north_m, east_m in ((6.0, 0.0), (6.0, 6.0), (0.0, 6.0), (0.0, 0.0)):
        world.goto(north_m, east_m)
        world.run_for(FLIGHT_S / 4.0)


def _lemniscate(world: World) -> None:
    for step in range(round(2.0 * FLIGHT_S)):
        world.goto(8.0 * math.sin(0.25 * step), 4.0 * math.sin(0.5 * step))
        world.run_for(0.5)


KINDS: Mapping[str, tuple[Callable[[World], None], Mapping[str, Any]]] = {
    "hover": (_hover, {}),
    "square": (_square, {}),
    "lemniscate": (_lemniscate, {"wind": (6.0, 0.0), "gust": 1.5}),
}


class _Truth:
    """The true states of the last moments, and the sensors' true biases."""

    def __init__(self, world: World) -> None:
        self._simulator, self._rows = world.engine.simulator, []  # type: ignore[var-annotated]
        self._world = world
        self.start_m = float(self._simulator.frame.state[2])
        """Position down of the vehicle at rest."""
        world.watch(self._take)

    def _take(self) -> None:
        self._rows.append((self._simulator.time_us * 1e-6, self._simulator.frame.state.copy()))
        if len(self._rows) > 100:
            del self._rows[:50]

    def state_at(self, time_s: float) -> FloatArray:
        times, states = np.array([t for t, _ in self._rows]), np.array([x for _, x in self._rows])
        return np.array([np.interp(time_s, times, column) for column in states.T])

    def biases(self) -> FloatArray:
        """Return the errors of gyro and accelerometer of a level vehicle: scale and alignment act on gravity."""
        sensors = self._simulator.sensors
        assert sensors is not None
        imu = sensors.imus.records[0]
        bias: FloatArray = imu["turn_on"] + imu["per_kelvin"] * imu["rise"] + imu["bias"]
        gravity = self._world.engine.stack.estimation.estimator.params.gravity_m_s2  # type: ignore[union-attr]
        bias[3:] -= (imu["matrix"][1] - np.eye(3))[:, 2] * gravity
        return bias


def _errors(world: World, truth: _Truth) -> tuple[FloatArray, FloatArray]:
    """Return truth minus estimate at the filter's horizon, shape (15,), and its covariance."""
    estimation = world.engine.stack.estimation
    assert estimation is not None
    assert estimation.estimator.frame is not None
    record = estimation.estimator.memory[0]
    x, true = record["nominal"], truth.state_at(float(record["clock"][0]))
    north_m, east_m, _ = LocalFrame(world.setup.home).to_ned(estimation.estimator.frame.origin)
    origin = np.array([north_m, east_m, truth.start_m])  # the height is that above the start
    attitude, estimate = Quaternion(*true[6:10].tolist()), Quaternion(*x[:4].tolist())
    turn = rotation_vector(quaternion_product(attitude, conjugate(estimate)))
    errors = np.concatenate(
        [
            turn,
            true[3:6] - x[4:7],
            true[:3] - x[7:10] - origin,
            truth.biases() - x[10:16],
        ]
    )
    return errors, symmetric(record["covariance"][:_PARTS, :_PARTS])


def fly(kind: str, seed: int) -> tuple[dict[str, float], dict[str, float]]:
    """Return NEES by state and NIS by sensor of one flight: sums of normalised squares over their number."""
    route, conditions = KINDS[kind]
    with World(vehicle="x_quad", state="estimated", seed=seed, **conditions) as world:
        world.wait_until_ready()
        truth = _Truth(world)
        world.takeoff(5.0)
        world.run_for(CLIMB_S)
        assert world.engine.stack.estimation is not None
        observations = world.engine.stack.estimation.estimator.memory["observations"][0]
        before = observations.copy()
        route(world)
        errors, covariance = _errors(world, truth)
        fused, nis_sum = (observations[name] - before[name] for name in ("fused", "nis_sum"))
    nees = {}
    for name, at in STATES.items():
        e, p = errors[list(at)], covariance[np.ix_(at, at)]
        nees[name] = float(e @ np.linalg.solve(p, e)) / len(at)
    nis = {name: float(nis_sum[list(rows)].sum() / fused[list(rows)].sum()) for name, rows in SENSORS.items()}
    return nees, nis


def consistency_of(values: FloatArray, freedom: int) -> Consistency:
    """Return the mean of independent values, each the mean of ``freedom`` squares, and its 95 % bounds."""
    total = freedom * len(values)
    low, high = stats.chi2.ppf((0.025, 0.975), total) / total
    return Consistency(float(np.mean(values)), float(low), float(high))


def campaign(
    flights: int, first_seed: int, workers: int | None = None
) -> dict[str, dict[str, Consistency | float]]:
    """Fly ``flights`` flights, of all kinds by turns; return the consistency by kind, and of all.

    They are flown by ``workers`` processes, with the same result for any number of these.
    """
    found: dict[str, list[tuple[dict[str, float], dict[str, float]]]] = {kind: [] for kind in KINDS}
    kinds = [kind for kind, _ in zip(itertools.cycle(KINDS), range(flights), strict=False)]
    with ProcessPoolExecutor(workers, get_context("spawn")) as pool:
        for kind, flight in zip(kinds, pool.map(fly, kinds, itertools.count(first_seed)), strict=True):
            found[kind].append(flight)
    found["all"] = [flight for kind in KINDS for flight in found[kind]]
    result: dict[str, dict[str, Consistency | float]] = {}
    for kind, rows in found.items():
        if rows:
            states = {
                name: consistency_of(np.array([nees[name] for nees, _ in rows]), len(at))
                for name, at in STATES.items()
            }
            sensors = {name: float(np.mean([nis[name] for _, nis in rows])) for name in SENSORS}
            result[kind] = {**states, **sensors}
    return result


def main() -> None:
    """Fly and print the table in Markdown, or JSON."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=12)
    parser.add_argument("--seed", type=int, default=1000, help="seed of the first flight")
    parser.add_argument("--workers", type=int, default=os.cpu_count(), help="processes")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    result = campaign(options.flights, options.seed, options.workers)
    if options.json:
        print(json.dumps(result))
        return
    print(f"| NEES, NIS | {' | '.join(result)} | 95 % of all |\n|---|{'---|' * (len(result) + 1)}")
    for name in (*STATES, *SENSORS):
        values = [row[name] for row in result.values()]
        cells = [f"{value.mean if isinstance(value, Consistency) else value:.2f}" for value in values]
        last = values[-1]
        bounds = f"{last.low:.2f} to {last.high:.2f}" if isinstance(last, Consistency) else ""
        print(f"| {name} | {' | '.join(cells)} | {bounds} |")


if __name__ == "__main__":
    main()
