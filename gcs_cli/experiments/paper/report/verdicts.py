"""The verdict on each claim of the paper, with the figures that decide it. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from gcs_cli.experiments.paper.findings.comparisons import steady_m
from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.pil_section import EMULATED
from gcs_cli.experiments.paper.report.labels import PLANTS, UNKNOWN, fixed, number

Results = Mapping[str, Any]
HOLDS, FAILS = "holds", "does not hold"
OURS = "our question"
"""Source of the claims that are not the paper's."""
_JUDGED = (cases.PID, cases.BACKSTEPPING)
_DISTURBED = ("force", "torque")
_NEGLIGIBLE = 1e-4


class Verdict(NamedTuple):
    """One claim: ``ok`` is True, False, or None where it depends on the plant or target."""

    claim: str
    source: str
    """Section of the paper, or ``OURS``."""
    ok: bool | None
    verdict: str
    figures: str
    section: str
    """Anchor of the section with the evidence."""


class _Figures(NamedTuple):
    section: str
    quantity: str
    keys: tuple[str, ...]
    unit: str
    factor: float = 1.0
    places: int = 1


_FIGURES = {
    "similar": _Figures(
        "fig-14", "RMS error, smooth profile (PID, PID with rate, backstepping)",
        ("pid_m", "rate_fed_pid_m", "backstepping_m"), "mm", 1e3,
    ),
    "overshoot": _Figures(
        "fig-14", "overshoot, hard profile (PID, PID with rate, backstepping)",
        ("pid_percent", "rate_fed_pid_percent", "backstepping_percent"), "%",
    ),
    "torque": _Figures(
        "disturbances", "error at rest, 20 mN m (PID, backstepping)", ("pid_m", "backstepping_m"), "mm", 1e3
    ),
    "spin_up": _Figures(
        "margins", "ticks with saturated yaw (PID, backstepping)",
        ("pid_percent", "backstepping_percent"), "%", places=0,
    ),
    "limits": _Figures(
        "fig-14", "overshoot difference (with, without limits)", ("limited_points", "unlimited_points"), "points"
    ),
    "survives": _Figures(
        "disturbances", "conditions not survived (PID, backstepping, PID with rate)",
        ("pid", "backstepping", "rate_fed_pid"), "", places=0,
    ),
    "method": _Figures(
        "fig-14", "overshoot (PD, PID with rate, backstepping)",
        ("poles_percent", "rate_fed_pid_percent", "backstepping_percent"), "%",
    ),
}  # fmt: skip


def verdicts(results: Results) -> list[Verdict]:
    """Return the claims of the paper, then this project's questions; claims without a flight are left out."""
    named: dict[str, list[Mapping[str, Any]]] = {}
    for claim in results["comparisons"]["claims"]:
        named.setdefault(claim["name"], []).append(claim)
    verdicts = [_verdict_of(results, found) for found in named.values()]
    verdicts += [*_disturbed(results), *_models(results), *_target(results)]
    return sorted(verdicts, key=lambda verdict: verdict.source == OURS)


def _verdict_of(results: Results, found: list[Mapping[str, Any]]) -> Verdict:
    """Return one verdict from those on each plant."""
    name, text = found[0]["name"], found[0]["claim"]
    source = found[0]["source"].replace("implied by the paper, ", "implied in ").removeprefix("paper, ")
    held = [_plant(claim) for claim in found if claim["holds"]]
    ok = True if len(held) == len(found) else None if held else False
    verdict = f"{HOLDS} on {', '.join(held)} only" if ok is None else HOLDS if ok else FAILS
    if name == "stable":
        return Verdict(text, source, ok, verdict, _margins(results, found), "margins")
    known = _FIGURES.get(name)
    if known is None:
        return Verdict(text, source, ok, verdict, " ".join(claim["words"] for claim in found), "fig-14")
    figures = "; ".join(f"{_plant(claim)} {_values(known, claim['figures'])}" for claim in found)
    return Verdict(text, source, ok, verdict, f"{known.quantity}: {figures}", known.section)


def _values(of: _Figures, figures: Mapping[str, Any]) -> str:
    if not figures:
        return "no comparison, a flight ended early"
    values = [figures[key] for key in of.keys]
    counts = [len(value) if isinstance(value, list) else of.factor * value for value in values]
    return f"{', '.join(fixed(count, of.places) for count in counts)} {of.unit}".rstrip()


def _plant(claim: Mapping[str, Any]) -> str:
    return PLANTS.get(claim["plant"], str(claim["plant"]))


def _margins(results: Results, found: list[Mapping[str, Any]]) -> str:
    axes = "; ".join(f"{_plant(one)}: {', '.join(one['figures']['nearer']) or 'none'}" for one in found)
    words = f"nearer: {axes}"
    loops = {
        loop["controller"]: of["margins"]["1000"]
        for loop in (results["linear"] or {}).get("loops", ())
        if loop["gains"] == "paper" and (of := sampled(loop["axes"]["roll"], FLOWN)) is not None
    }
    if len(loops) == len(_JUDGED) and None not in loops.values():
        pair = ", ".join(f"{fixed(of['gain_db'])} dB, {fixed(of['phase_deg'], 0)}°" for of in loops.values())
        words += f". Roll (PID, backstepping): {pair}"
    return words


FLOWN, SPIN_UP = "motor lag", "motor lag with spin-up torque"
"""Names of actuators in the results."""


def sampled(of: Mapping[str, Any], actuators: str) -> Mapping[str, Any] | None:
    """Return the sampled analysis of an axis with these actuators; None if there is none."""
    return next((entry for entry in of["sampled"] if entry["actuators"] == actuators), None)


def _disturbed(results: Results) -> Iterator[Verdict]:
    keys = [
        [cases.key(name, cases.SMOOTH, condition, plant) for name in _JUDGED for condition in _DISTURBED]
        for plant in (cases.SMALL_ANGLE, cases.RIGID)
    ]
    found = results["cases"]
    if not all(key in found for of in keys for key in of):
        return
    ended = [key for of in keys for key in of if found[key]["ended"] is not None]
    errors = [
        f"{PLANTS[plant]} "
        + ", ".join(
            _steady_mm(found[cases.key(name, cases.SMOOTH, _DISTURBED[0], plant)]) for name in _JUDGED
        )
        for plant in (cases.SMALL_ANGLE, cases.RIGID)
    ]
    yield Verdict(
        "stable flight under sustained disturbances", "I", not ended, FAILS if ended else HOLDS,
        f"error at rest, 0.5 N wind (PID, backstepping): {'; '.join(errors)} mm", "disturbances",
    )  # fmt: skip


def _steady_mm(case: Mapping[str, Any]) -> str:
    return fixed(1e3 * steady_m(case)) if case["ended"] is None else UNKNOWN


def _models(results: Results) -> Iterator[Verdict]:
    of = results["plants"].get(f"{cases.RIGID}_{cases.MULTIBODY}", {})
    decided = [one for one in of.values() if one["bound_decides"]]
    if not decided:
        return
    ok = all(one["within_bounds"] for one in decided)
    apart = (max(one[key] for one in decided) for key in ("max_position_m", "max_attitude_deg"))
    position_m, attitude_deg = apart
    yield Verdict(
        "mathematical and physical model agree", "abstract", ok,
        HOLDS + (" where the loops are stable" if len(decided) < len(of) else "") if ok else FAILS,
        f"rigid body to multibody: at most {small(1e3 * position_m)} mm, {small(attitude_deg)}°", "plants",
    )  # fmt: skip


def small(value: float) -> str:
    """Return a difference; below 10⁻⁴ only that bound."""
    return f"<{_NEGLIGIBLE:g}" if value < _NEGLIGIBLE else number(value)


def _target(results: Results) -> Iterator[Verdict]:
    same, pil = same_bits(results), results["pil"]
    if same is None:
        return
    apart = [
        row["largest"]
        for _, _, of in pil_flights(pil)
        for row in of["differences"]
        if row["signal"] == "position" and row["pair"] == "MIL–PIL" and row["largest"] is not None
    ]
    figures = f"host and target: {'same bits' if same else 'different bits'}"
    if apart:
        figures += f"; Python loops and target: at most {number(1e6 * max(apart))} µm apart"
    where = "an emulated Cortex-M4F" if pil["target"] == EMULATED else pil["target"]
    yield Verdict(
        "the code on the target matches the simulation", "IV.C", same,
        f"{HOLDS} on {where}" if same else FAILS, figures, "fig-15",
    )  # fmt: skip


def pil_flights(pil: Mapping[str, Any]) -> list[tuple[str, str, Mapping[str, Any]]]:
    """Return controller, plant and comparison of each mission flown with the loops on a target."""
    return [
        (name, plant, of)
        for plant, found in ((pil["plant"], pil["controllers"]), (cases.RIGID, pil["rigid"]))
        for name, of in found.items()
    ]


def same_bits(results: Results) -> bool | None:
    """True if SIL and PIL gave the same bits in all signals of all flights; None without flights."""
    pil = results["pil"]
    if not pil or not pil["controllers"]:
        return None
    rows = [row for _, _, of in pil_flights(pil) for row in of["differences"] if row["pair"] == "SIL–PIL"]
    return bool(rows) and all(row["largest"] == 0.0 for row in rows)


def endings(results: Results) -> tuple[int, int]:
    """Return the number of flights that crashed and that lost control."""
    hows = [case["ended"]["how"] for case in results["cases"].values() if case["ended"] is not None]
    return hows.count("crashed"), hows.count("lost")


def space_rms_m(case: Mapping[str, Any]) -> float:
    """Return the RMS distance from the reference in space [m], from the RMS errors of the axes."""
    return math.sqrt(sum(case["metrics"][axis]["rms_error"] ** 2 for axis in "xyz"))
