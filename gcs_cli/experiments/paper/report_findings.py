"""What the report's summary takes from the results: verdicts, crashes, the largest of the differences. Pure."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeAlias

from gcs_cli.experiments.paper import cases

Results: TypeAlias = Mapping[str, Any]
"""The content of results.json."""
_PAPERS = "paper"


def paper_claims(results: Results) -> dict[str, list[Mapping[str, Any]]]:
    """Return what the paper claims or implies (not our questions) by its name, each with its verdict on every plant."""
    named: dict[str, list[Mapping[str, Any]]] = {}
    for claim in results["comparisons"]["claims"]:
        if _PAPERS in claim["source"]:
            named.setdefault(claim["name"], []).append(claim)
    return named


def flies(case: Mapping[str, Any] | None) -> bool:
    """Tell whether a case was flown, and to its end."""
    return case is not None and case["ended"] is None


def ended(results: Results, how: str) -> list[str]:
    """Return the keys of the flights that ended before their time, "crashed" or "lost"."""
    return [
        name
        for name, case in results["cases"].items()
        if case["ended"] is not None and case["ended"]["how"] == how
    ]


def worst_plants(results: Results) -> tuple[float, float] | None:
    """Return by how much rigid body and multibody differ at most [m, °], of all whose loops do not magnify rounding."""
    found = results["plants"].get(f"{cases.RIGID}_{cases.MULTIBODY}", {})
    of = {name: one for name, one in found.items() if one["bound_decides"]}
    if not of:
        return None
    return max(one["max_position_m"] for one in of.values()), max(
        one["max_attitude_deg"] for one in of.values()
    )


def onset_apart(results: Results) -> float | None:
    """Return the largest difference between simulated and predicted onset [%]; None if there is none."""
    apart = [
        abs(one["difference_percent"])
        for one in results["onset"] or ()
        if one["difference_percent"] is not None
    ]
    return max(apart, default=None)


def pil_flights(pil: Mapping[str, Any]) -> list[tuple[str, str, Mapping[str, Any]]]:
    """Return controller, plant and comparison of each mission that was flown with the loops on a target."""
    return [
        (name, plant, of)
        for plant, found in ((pil["plant"], pil["controllers"]), (cases.RIGID, pil["rigid"]))
        for name, of in found.items()
    ]


def same_bits(results: Results) -> bool | None:
    """Tell whether SIL and PIL gave the same bits in all signals of all flights; None if they were not flown."""
    pil = results["pil"]
    if not pil or not pil["controllers"]:
        return None
    rows = [row for _, _, of in pil_flights(pil) for row in of["differences"] if row["pair"] == "SIL–PIL"]
    return bool(rows) and all(row["largest"] == 0.0 for row in rows)
