"""The content of ``pil.json``: flights compared, the target's figures, and the verdict. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations
from typing import Any, NamedTuple

from flightstack.core.contract import FloatArray
from gcs_cli.pil.compare import (
    Difference,
    compared,
    deviation,
    status_differences,
    ticks_apart,
)
from gcs_cli.pil.flight_samples import FlightSamples
from gcs_cli.pil.profile import StageProfile, branch_costs, cpu_load, stage_profiles
from gcs_cli.pil.report_charts import DeviationChart
from gcs_cli.pil.signals import BY_NAME
from gcs_cli.pil.target_record import TargetRecord
from gcs_cli.pil.verdict import (
    DEFAULT_LIMITS,
    MIL,
    PIL,
    SIL,
    Check,
    Limits,
    all_passed,
    board_limits,
    difference_checks,
    same_bits_limits,
)

FORMAT = "flightstack-pil-1"
PASSED, FAILED = "passed", "failed"
COMPLETED = "completed"
"""Outcome of a completed flight; see ``flight_outcome``."""
WALL_TIME = "ns"
"""Unit of the costs of a target that is a program on this machine."""
_SHOWN = ("position", "target_attitude", "torque", "rotor_command")
_LANDING_TICKS = 25.0
"""Largest difference of the ticks of landing: touchdowns that differ are detected in different ticks."""
_SHARE_OF_STATUS = 1e-3


class Flown(NamedTuple):
    """One flight of the comparison."""

    outcome: str
    samples: FlightSamples | None
    """None without a readable log."""
    facts: Mapping[str, Any]
    """Other values for ``pil.json``."""
    outcome_text: str = ""
    """The outcome as a sentence."""


class Outcome(NamedTuple):
    """The content of ``pil.json``, and the data of the report."""

    result: dict[str, Any]
    charts: list[DeviationChart]
    profiles: list[StageProfile]
    costs: FloatArray | None = None
    """Cost of the stages of each step, (steps, 4); None without a target that measures them."""

    @property
    def passed(self) -> bool:
        """The verdict."""
        return bool(self.result["verdict"] == PASSED)


def pair_name(first: str, second: str) -> str:
    """Name a pair of flights."""
    return f"{first}–{second}"


def closed_loop(
    flights: Mapping[str, Flown],
    record: TargetRecord | None,
    same_bits: bool,
    facts: Mapping[str, Any],
    limits: Limits = DEFAULT_LIMITS.flight,
) -> Outcome:
    """Compare the flights MIL, SIL and PIL, each with its own vehicle, and check them.

    ``same_bits``: the target's arithmetic is bit-identical to the host's. ``facts``: title, about, meaning and
    conditions.
    """
    there = {stage: flown.samples for stage, flown in flights.items() if flown.samples is not None}
    differences: dict[str, list[Difference]] = {}
    charts = {name: DeviationChart(BY_NAME[name], {}) for name in _SHOWN}
    for (a, first), (b, second) in combinations(there.items(), 2):
        pair = pair_name(a, b)
        exact = same_bits and MIL not in (a, b)
        differences[pair] = list(compared(pair, first, second, airborne=not exact))
        for name, chart in charts.items():
            chart.pairs[pair] = deviation(BY_NAME[name], first, second, airborne=not exact)
    checks = [
        Check("flights that failed", 0.0, _failures(flights), "", _reasons(flights)),
        *_closed_loop_checks(there, differences, same_bits, limits),
        *(target_checks(record, len(there[PIL].flown_us)) if PIL in there else ()),
    ]
    listed = [difference for pair in differences.values() for difference in pair]
    result = assembled(listed, checks, record, facts)
    result["flights"] = {stage: _of_flight(flown) for stage, flown in flights.items()}
    result["status_differences"] = {
        pair_name(a, b): status_differences(first, second)[0]
        for (a, first), (b, second) in combinations(there.items(), 2)
    }
    result["compared"] = _ABOUT_TICKS + ("every tick in which the loops run." if same_bits else "the same.")
    result["tiles"] = [*_tiles(differences, checks), *target_tiles(record)]
    return Outcome(result, list(charts.values()), profiles_of(record), costs_of(record))


def assembled(
    differences: Iterable[Difference],
    checks: Sequence[Check],
    record: TargetRecord | None,
    facts: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the keys that every ``pil.json`` has."""
    return {
        "format": FORMAT,
        "inner_hz": None,
        "coverage": None,
        "stack_usage": None,
        **facts,
        "verdict": PASSED if all_passed(checks) else FAILED,
        "checks": [check.as_json() for check in checks],
        "differences": [found.as_json(BY_NAME[found.signal]) for found in differences],
        "profile": _profile(record),
        "load": _load(record, facts.get("inner_hz")),
        "target": None if record is None else dict(record.identity),
        "stack": _stack(record),
        "link": {} if record is None else dict(record.link),
        "target_counters": {} if record is None else record.counted,
        "target_status_before": None if record is None else dict(record.at_start),
        "target_status_after": None if record is None else dict(record.status) or None,
        "flights": {},
        "compared": "Every step.",
    }


def _failures(flights: Mapping[str, Flown]) -> float:
    done = sum(flown.outcome == COMPLETED and flown.samples is not None for flown in flights.values())
    return float(len((MIL, SIL, PIL)) - done)


def _reasons(flights: Mapping[str, Flown]) -> str:
    """Name the stages that failed by their outcome; their reason is the flight's ``outcome_text``."""
    reasons = [f"{stage}: {flown.outcome}" for stage, flown in flights.items() if flown.outcome != COMPLETED]
    blank = [
        stage for stage, flown in flights.items() if flown.outcome == COMPLETED and flown.samples is None
    ]
    missing = [stage for stage in (MIL, SIL, PIL) if stage not in flights]
    reasons += [f"{stage}: its log is not readable" for stage in blank]
    return "; ".join([*reasons, *(f"{stage}: not flown" for stage in missing)])


def _closed_loop_checks(
    flights: Mapping[str, FlightSamples],
    differences: Mapping[str, Sequence[Difference]],
    same_bits: bool,
    limits: Limits,
) -> Iterator[Check]:
    for a, b in combinations(flights, 2):
        pair, first, second = pair_name(a, b), flights[a], flights[b]
        exact = same_bits and MIL not in (a, b)
        apart = float(ticks_apart(first, second))
        yield Check(f"{pair} ticks flown by one alone", 0.0 if exact else _LANDING_TICKS, apart, "")
        if MIL not in (a, b):
            yield status_check(f"{pair} ticks of another status", first, second, exact)
        of_pair = limits
        if MIL not in (a, b):
            of_pair = same_bits_limits(limits) if exact else board_limits(limits)
        yield from difference_checks(pair, differences[pair], of_pair)


def status_check(name: str, first: FlightSamples, second: FlightSamples, exact: bool) -> Check:
    """Return the check of the loops' status; it fails without common ticks."""
    differing, ticks = status_differences(first, second)
    if not ticks:
        return Check(name, 0.0, math.nan, "", "no ticks to compare")
    return Check(name, 0.0 if exact else math.ceil(_SHARE_OF_STATUS * ticks), float(differing), "")


def target_checks(record: TargetRecord | None, ticks: int) -> Iterator[Check]:
    """Yield the checks of a target after ``ticks`` ticks; ``record`` is None without one.

    Safe states and overruns are in the reports of the steps and in the target's own counters, which also cover the
    time between steps. The larger value counts.
    """
    name = "steps flown without the target"
    if record is None:
        yield Check(name, 0.0, float(max(1, ticks)), "", "no record of the target is there")
        return
    yield Check(name, 0.0, float(max(0, ticks - record.steps)), "", record.ending or "")
    told = "" if record.status else "FS_PIL_STATUS was asked for in vain after the last step"
    yield Check("counters that the target did not tell", 0.0, float(not record.status), "", told)
    safe_states, overruns = record.bad_inputs, record.overruns
    if record.status:
        safe_states = max(safe_states, record.counted["safe_states"])
        overruns = max(overruns, record.counted["loop_overruns"])
    yield Check("safe states of the target", 0.0, float(safe_states), "")
    if record.unit != WALL_TIME:  # not judged: other programs run on this machine too
        yield Check("steps that overran their period", 0.0, float(overruns), "")


def costs_of(record: TargetRecord | None) -> FloatArray | None:
    """Return the costs of all steps, or None if the target measures none."""
    return None if record is None or not record.unit else record.costs


def profiles_of(record: TargetRecord | None) -> list[StageProfile]:
    """Return the profile of each stage; empty if the target measures no cost."""
    return [] if record is None or not record.unit else stage_profiles(record.costs)


def _load(record: TargetRecord | None, inner_hz: float | None) -> dict[str, Any] | None:
    if record is None:
        return None
    load = cpu_load(profiles_of(record), record.unit, record.identity["clock_hz"], inner_hz)
    return None if load is None else load.as_json()


def _profile(record: TargetRecord | None) -> dict[str, Any] | None:
    if record is None:
        return None
    return {
        "unit": record.unit,
        "about": _ABOUT_UNIT.get(record.unit, ""),
        "stages": {profile.stage: profile.as_json() for profile in profiles_of(record)},
        "branches": branch_costs(record.costs, record.statuses) if record.unit else {},
    }


_ABOUT_TICKS = (
    "MIL with SIL and PIL: the ticks in which both fly and touch nothing. A touchdown is an impact, after which "
    "flights that were a micrometre apart go different ways. SIL with PIL: "
)
_ABOUT_UNIT = {
    "cycles": "Processor cycles, counted on the board.",
    "instructions": (
        "Instructions executed under emulation. They repeat exactly, and are no time: how many cycles an instruction "
        "takes depends on the processor, its memory and its pipeline."
    ),
    WALL_TIME: "Nanoseconds of this machine, which did other things as well.",
}


def _stack(record: TargetRecord | None) -> dict[str, Any] | None:
    if record is None or not record.status or not record.status["stack_size"]:
        return None
    return {"size": record.status["stack_size"], "high_water": record.status["stack_high_water"]}


def _of_flight(flown: Flown) -> dict[str, Any]:
    outcome = {"outcome": flown.outcome, "outcome_text": flown.outcome_text}
    return {**outcome, **_of_samples(flown.samples), **flown.facts}


def _of_samples(samples: FlightSamples | None) -> dict[str, Any]:
    if samples is None:
        return {"ticks": None, "airborne_ticks": None, "loops": None}
    version = samples.info.get("ver_loops") or samples.info.get("loops")
    return {"ticks": len(samples.flown_us), "airborne_ticks": len(samples.airborne_us), "loops": version}


def _tiles(differences: Mapping[str, Sequence[Difference]], checks: Sequence[Check]) -> list[dict[str, str]]:
    tiles, ours, designed = [], pair_name(SIL, PIL), pair_name(MIL, PIL)
    if ours in differences:
        tiles.append({"name": f"largest difference {ours}", "value": largest_difference(differences[ours])})
    for found in differences.get(designed, ()):
        if found.signal == "position":
            tiles.append({"name": f"trajectory {designed}", "value": f"{found.largest * 1e6:.3g} µm"})
    margins = [
        check.margin for check in checks if check.name.startswith(designed) and check.margin is not None
    ]
    if margins:
        tiles.append({"name": f"smallest margin {designed}", "value": f"{min(margins):.3g}×"})
    return tiles


def target_tiles(record: TargetRecord | None) -> list[dict[str, str]]:
    """Return the figures of target and link at the top of a report."""
    if record is None:
        return []
    tiles = [{"name": "steps on the target", "value": f"{record.steps}"}]
    whole = next((profile for profile in profiles_of(record) if profile.stage == "whole"), None)
    if whole is not None:
        tiles.append({"name": f"most {record.unit} of a step", "value": f"{whole.largest:.0f}"})
    return [*tiles, {"name": "frames sent again", "value": f"{record.link['resent']}"}]


def largest_difference(differences: Sequence[Difference]) -> str:
    """Format the largest difference in ulps."""
    if not differences:
        return "–"
    largest = max(found.ulps for found in differences)
    return "same bits" if largest == 0.0 else f"{largest:.3g} ulp"
