"""Results of the paper's experiments for tests of its report: flights at low rates, other parts made by hand."""

from __future__ import annotations

from functools import cache
from typing import Any

from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.flights.closed_loop import fly
from gcs_cli.experiments.paper.flights.experiments import Flown, entry_of
from gcs_cli.experiments.paper.flights.types import Case
from gcs_cli.experiments.paper.linear.onset import SETTINGS
from gcs_cli.experiments.paper.linear.tables import LOOPS
from gcs_cli.experiments.paper.results import results_of

INNER_HZ, OUTER_HZ = 250, 125
CONTENDERS = [one for one in cases.CONTENDERS if one.name in (cases.PID, cases.BACKSTEPPING, cases.POLES)]
SIMPLE = [one for one in cases.CONDITIONS if one.name in (cases.PLAIN, cases.IDEAL)]


@cache
def small_flights() -> Flown:
    """Fly three contenders along each trajectory. The rates are low, so the figures are not the paper's."""
    chosen = cases.matrix((cases.DESIRED,), (cases.SMALL_ANGLE, cases.RIGID), CONTENDERS, SIMPLE[:1])
    chosen += cases.matrix((cases.SMOOTH, cases.HARD), (cases.SMALL_ANGLE,), CONTENDERS, SIMPLE)
    chosen += cases.matrix(cases.STEPS, (cases.SMALL_ANGLE,), CONTENDERS, SIMPLE[:1])
    recordings = {case.key: fly(_quick(case)) for case in chosen}
    return Flown({key: entry_of(one) for key, one in recordings.items()}, recordings)


def _quick(case: Case) -> Case:
    return case._replace(inner_hz=INNER_HZ, outer_hz=OUTER_HZ)


def small_results() -> dict[str, Any]:
    """Return the content of results.json for ``small_flights``. The caller may change it."""
    return results_of(small_flights(), {})


def full_results() -> dict[str, Any]:
    """Return results with every case of ``gcs paper``, filled with ``small_flights``, to test the size of the page."""
    flown = small_flights()
    sources = {
        (name, trajectory): cases.key(name, trajectory)
        for name in (cases.PID, cases.BACKSTEPPING)
        for trajectory in (*cases.PATHS, *cases.STEPS)
    }
    entries, recordings = {}, {}
    for case in cases.all_cases(multibody=True):
        controller = cases.PID if case.controller == "pid" else cases.BACKSTEPPING
        source = sources[controller, case.trajectory]
        entries[case.key], recordings[case.key] = flown.entries[source], flown.recordings[source]
    results = results_of(Flown(entries, recordings), {})
    linear, onset = linear_part(), onset_part()
    loop, one = linear["loops"][0], onset[0]
    linear["loops"] = [
        {**loop, "controller": controller, "gains": gains, "axes": _distinct(loop["axes"], index)}
        for index, (controller, gains) in enumerate(LOOPS)
    ]
    onset = [
        {**one, "controller": controller, "gains": gains, "setting": setting.name, "axis": axis}
        for controller, gains in LOOPS
        for setting in SETTINGS
        for axis in setting.axes
    ]
    return results | {"linear": linear, "onset": onset, "pil": pil_part()}


def _distinct(axes: dict[str, Any], index: int) -> dict[str, Any]:
    """Return axes whose gains and overshoot depend on ``index``."""
    return {
        name: {
            **of,
            "gains": {**of["gains"], "kp": 100.0 + index},
            "step": {**of["step"], "overshoot_percent": 1.5 + index},
        }
        for name, of in axes.items()
    }


def linear_part() -> dict[str, Any]:
    """Return the linear analysis of one loop, as in results.json."""
    law = {"kp": 100.0, "ki": 0.0, "kd": 16.0, "rate_feedforward": 1.0, "acceleration_feedforward": 0.0}
    margin = {
        "gain_db": 12.34,
        "reduction_db": None,
        "phase_deg": 56.7,
        "crossover_rad_s": 1.0,
        "delay_s": 0.1,
    }
    rates = {"250": None, "1000": margin}
    axis = {
        "gains": law,
        "natural_rad_s": 10.0,
        "damping": 0.8,
        "poles": [[-8.0, -6.0], [-8.0, 6.0]],
        "step": {"overshoot_percent": 1.5, "peak_s": 0.3, "rise_s": 0.1, "settling_s": 0.4},
        "largest_lag_s": 0.0219,
        "sampled": [
            {"actuators": "motor lag", "margins": rates, "lowest_stable_hz": 123.4},
            {"actuators": "motor lag with spin-up torque", "margins": {"250": None, "1000": None},
             "lowest_stable_hz": 1759.4},
            {"actuators": "ideal rotors, one step of delay", "margins": rates, "lowest_stable_hz": 222.2},
        ],
    }  # fmt: skip
    outer = {
        **axis,
        "slowest": {"natural_rad_s": 3.49, "damping": 0.41},
        "step": {"overshoot_percent": 24.7, "peak_s": 1.0, "rise_s": 0.4, "settling_s": 2.48},
        "sampled": [
            {"actuators": "motor lag", "margins": {"1000/250": margin}, "lowest_stable_outer_hz": 6.08},
        ],
    }
    axes = dict.fromkeys(("roll", "pitch", "yaw"), axis) | dict.fromkeys(("x", "y", "z"), outer)
    loops = [{"controller": "pid", "gains": "paper", "axes": axes}]
    return {"motor_lag_s": 0.005, "spin_up_lead_s": 0.204, "loops": loops}


def onset_part() -> list[dict[str, Any]]:
    """Return two onsets of instability, one of them without a rate."""
    found = {
        "controller": "pid",
        "gains": "paper",
        "setting": "ideal rotors, one step of delay",
        "axis": "roll",
    }
    return [
        {**found, "simulated_hz": 203.25, "predicted_hz": 203.0, "difference_percent": 0.123},
        {**found, "axis": "yaw", "simulated_hz": None, "predicted_hz": None, "difference_percent": None},
    ]


def pil_part() -> dict[str, Any]:
    """Return the comparison of a flight on the emulated target, as in results.json."""
    stage = {
        "count": 100,
        "min": 891.0,
        "mean": 980.25,
        "p99": 1254.0,
        "max": 2485.0,
        "histogram": {"edges": [890.5, 1690.5, 2490.5], "counts": [99, 1]},
    }
    row = {
        "signal": "position",
        "stage": "trajectory",
        "unit": "m",
        "samples": 9,
        "at_s": 1.5,
        "full_scale": 3.0,
    }
    apart = {"largest": 4.77e-7, "rms": 1e-7, "ulps": 2.0, "rms_ulps": 0.4, "float32_steps": 2}
    same = {"largest": 0.0, "rms": 0.0, "ulps": 0.0, "rms_ulps": 0.0, "float32_steps": 0}
    check = {
        "name": "SIL–PIL wrench",
        "passed": True,
        "limit": 0.0,
        "measured": 0.0,
        "margin": None,
        "unit": "ulp",
    }
    of = {
        "verdict": "passed",
        "checks": [{**check, "about": "same bits"}],
        "differences": [{**row, **apart, "pair": "MIL–PIL"}, {**row, **same, "pair": "SIL–PIL"}],
        "compared": "Every step.",
        "profile": {"unit": "instructions", "about": "They are no time.", "stages": {"whole": stage}},
        "target": {
            "board": "emulated Cortex-M4F", "compiler": "zig", "source_hash": "d61c", "clock_hz": 0, "char_bits": 8,
        },
        "stack": {"size": 16384, "high_water": 872},
        "flights": {},
    }  # fmt: skip
    return {
        "target": "emulated",
        "why_left_out": None,
        "meaning": "It stands for no board.",
        "mission": "takeoff and landing",
        "why_so": "It is a mission and no path.",
        "gains": "paper",
        "plant": "paper",
        "inner_hz": 1000.0,
        "outer_hz": 250.0,
        "controllers": {"pid": of, "backstepping": of},
        "rigid": {"backstepping": of},
    }
