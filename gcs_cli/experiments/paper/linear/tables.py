"""All figures of the linear analysis as plain data, for ``results.json`` and the report."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import brentq

from flightstack.params.vehicle import DEFAULT_VEHICLE, load_vehicle
from gcs_cli.experiments.paper.linear.continuous import (
    DIRECT,
    attitude_loop,
    is_stable,
    pair_mode,
    position_loop,
    slowest_mode,
    tilt_loop,
)
from gcs_cli.experiments.paper.linear.gains import ATTITUDE_AXES, POSITION_AXES, AttitudeGains, Gains
from gcs_cli.experiments.paper.linear.margins import Margins, lowest_stable_hz, margins, spectral_radius
from gcs_cli.experiments.paper.linear.onset import (
    SETTINGS,
    find_onset,
    find_outer_onset,
    lowest_outer_hz,
)
from gcs_cli.experiments.paper.linear.sampled import TILT_OF, Actuators, AttitudeTick, Rates, period_of
from gcs_cli.experiments.paper.linear.small_signal import flown_gains, spin_up_lead_s
from gcs_cli.experiments.paper.linear.steps import exact_figures

LOOPS = (
    ("pid", "paper"),
    ("backstepping", "paper"),
    ("pid", "tuned"),
    ("backstepping", "tuned"),
    ("pid", "paper_rate_fed"),
)
"""Controllers with their gains files; the linear PD with backstepping's poles is backstepping here."""
INNER_RATES_HZ = (250.0, 500.0, 1000.0)
CASCADE_RATES = (Rates(250.0, 50.0), Rates(500.0, 100.0), Rates(1000.0, 250.0))
_SHORTEST_LAG_S = 1e-3
_DIGITS = 10


def results() -> dict[str, Any]:
    """Return poles, step responses, margins and lowest rates of every loop.

    ``loops`` is a list with ``controller``, ``gains`` and ``axes``: for each axis its gains, continuous poles, the
    natural frequency and damping that kp and kd place, the closed form of its step response, and ``sampled``: a list
    of actuators, each with margins at the rates and the lowest stable rate; attitudes also have ``largest_lag_s``, the
    motor lag that ends stability at 1 kHz. Times in seconds, angles in degrees,
    gains in decibels; None for a missing figure (margins of an unstable loop).
    """
    vehicle = load_vehicle(DEFAULT_VEHICLE)
    return {
        "vehicle": vehicle.name,
        "motor_lag_s": vehicle.rotors[0].lag_s,
        "spin_up_lead_s": _rounded(spin_up_lead_s(vehicle)),
        "loops": [_loop(controller, gains) for controller, gains in LOOPS],
        "without_reference_rate": _without_reference_rate(),
    }


def onset() -> list[dict[str, Any]]:
    """Return the lowest stable rates that simulation finds beside the predicted ones: inner, then outer loops.

    An inner loop with the same feedback as an earlier one is left out.
    """
    found: list[dict[str, Any]] = []
    known: set[tuple[float, ...]] = set()
    for controller, gains in LOOPS:
        attitude = flown_gains(controller, gains).attitude.values()
        feedback = tuple(value for law in attitude for value in (law.kp, law.ki, law.kd))
        settings = () if feedback in known else SETTINGS
        known.add(feedback)
        ones = [find_onset(controller, gains, setting, axis) for setting in settings for axis in setting.axes]
        ones += [find_outer_onset(controller, gains, axis) for axis in POSITION_AXES]
        found += [_plain(one._asdict() | {"difference_percent": one.difference_percent}) for one in ones]
    return found


def _plain(values: dict[str, Any]) -> dict[str, Any]:
    return {name: _rounded(value) for name, value in values.items()}


def _rounded(value: Any) -> Any:
    """Round to ten digits, because the last ones of an eigenvalue depend on the linear algebra library."""
    if isinstance(value, float) and math.isfinite(value) and value != 0.0:
        return float(f"{value:.{_DIGITS - 1}e}")
    return value


def actuator_settings(axis: str) -> list[tuple[str, Actuators]]:
    """Return the actuators that an axis is analysed with, and their names."""
    vehicle = load_vehicle(DEFAULT_VEHICLE)
    lag_s = vehicle.rotors[0].lag_s
    settings = [
        ("ideal rotors", Actuators()),
        ("ideal rotors, one step of delay", Actuators(1)),
        ("motor lag", Actuators(0, lag_s)),
        ("motor lag, one step of delay", Actuators(1, lag_s)),
    ]
    if axis == "yaw":
        lead_s = spin_up_lead_s(vehicle)
        settings.append(("motor lag with spin-up torque", Actuators(0, lag_s, lead_s)))
    return settings


def _loop(controller: str, gains_name: str) -> dict[str, Any]:
    gains = flown_gains(controller, gains_name)
    axes = {axis: _attitude_axis(gains.attitude[axis], axis) for axis in ATTITUDE_AXES}
    axes |= {axis: _position_axis(gains, axis) for axis in POSITION_AXES}
    return {"controller": controller, "gains": gains_name, "axes": axes}


def _attitude_axis(law: AttitudeGains, axis: str) -> dict[str, Any]:
    feedback = attitude_loop(law._replace(rate_feedforward=0.0, acceleration_feedforward=0.0))

    def tick(hz: float, actuators: Actuators) -> AttitudeTick:
        return AttitudeTick(law, hz, actuators)

    sampled = [
        {
            "actuators": name,
            "margins": {
                f"{hz:g}": _margins(margins(tick(hz, actuators).open(), 1.0 / hz)) for hz in INNER_RATES_HZ
            },
            "lowest_stable_hz": _rounded(
                lowest_stable_hz(lambda hz, a=actuators: spectral_radius(tick(hz, a).closed()))  # type: ignore[misc]
            ),
        }
        for name, actuators in actuator_settings(axis)
    ]
    return {
        "gains": _plain(law._asdict()),
        **_mode(law),
        "poles": _poles(feedback.poles()),
        "step": _figures(feedback),
        "sampled": sampled,
        "largest_lag_s": _rounded(_largest_lag_s(law)),
    }


def _largest_lag_s(law: AttitudeGains) -> float | None:
    """Return the largest motor lag at which the loop is stable at 1 kHz without delay; None: any up to 1 s.

    In continuous time it is kd/kp: s² (lag s + 1) + kd s + kp has all its roots on the left below that.
    """
    hz = INNER_RATES_HZ[-1]

    def excess(lag_s: float) -> float:
        return spectral_radius(AttitudeTick(law, hz, Actuators(0, lag_s)).closed()) - 1.0

    lags = np.geomspace(_SHORTEST_LAG_S, 1.0, 60).tolist()
    for shorter, longer in pairwise(lags):
        if excess(longer) >= 0.0:
            return float(brentq(excess, shorter, longer, xtol=1e-12))
    return None


def _mode(law: Any) -> dict[str, Any]:
    mode = pair_mode(law)
    return {"natural_rad_s": _rounded(mode.natural_rad_s), "damping": _rounded(mode.damping)}


def _poles(poles: list[complex]) -> list[list[float]]:
    return [[_rounded(pole.real), _rounded(pole.imag)] for pole in poles]


def _figures(loop: Any) -> dict[str, Any] | None:
    figures = exact_figures(loop)
    return None if figures is None else _plain(figures._asdict())


def _margins(found: Margins | None) -> dict[str, Any] | None:
    return None if found is None else _plain(found._asdict())


def _position_axis(gains: Gains, axis: str) -> dict[str, Any]:
    law = gains.position[axis]
    inner = DIRECT if axis == "z" else tilt_loop(gains.attitude[TILT_OF[axis]], gains.reference)
    loop = position_loop(law, inner)
    poles = loop.poles()
    slowest = slowest_mode(poles)
    sampled = [
        {
            "actuators": name,
            "margins": {
                f"{rates.inner_hz:g}/{rates.outer_hz:g}": _margins(
                    margins(period_of(gains, axis, rates, actuators).open(), 1.0 / rates.outer_hz)
                )
                for rates in CASCADE_RATES
            },
            "lowest_stable_outer_hz": _rounded(lowest_outer_hz(gains, axis, actuators)),
        }
        for name, actuators in actuator_settings(axis)
    ]
    return {
        "gains": _plain(law._asdict()),
        **_mode(law),
        "poles": _poles(poles),
        "stable": is_stable(poles),
        "slowest": {"natural_rad_s": _rounded(slowest.natural_rad_s), "damping": _rounded(slowest.damping)},
        "step": _figures(loop),
        "sampled": sampled,
    }


def _without_reference_rate() -> dict[str, Any]:
    """Return backstepping's x loop without the feedforward ẋ_d, with and without the reference filter."""
    gains = flown_gains("backstepping", "paper")
    law = gains.attitude["pitch"]._replace(rate_feedforward=0.0)
    found = {}
    for name, reference in (
        ("filtered", gains.reference),
        ("unfiltered", gains.reference._replace(bandwidth_rad_s=0.0)),
    ):
        loop = position_loop(gains.position["x"], tilt_loop(law, reference))
        attitude = {**gains.attitude, "pitch": law}
        changed = gains._replace(attitude=attitude, reference=reference)
        period = period_of(changed, "x", CASCADE_RATES[-1], Actuators())
        found[name] = {
            "damping": _rounded(slowest_mode(loop.poles()).damping),
            "step": _figures(loop),
            "margins": _margins(margins(period.open(), 1.0 / period.rates.outer_hz)),
        }
    return found
