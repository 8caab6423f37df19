"""Verdicts on the paper's claims."""

from __future__ import annotations

from typing import Any

import pytest

from gcs_cli.experiments.paper.findings import claims as claims_module
from gcs_cli.experiments.paper.findings import claims_stability, comparisons
from gcs_cli.experiments.paper.findings.claims import claims
from gcs_cli.experiments.paper.findings.comparisons import shared_overshoots
from gcs_cli.experiments.paper.findings.verdicts import NotFlownError, flight
from gcs_cli.experiments.paper.flights.cases import (
    BACKSTEPPING,
    PID,
    POLES,
    RIGID,
    SMALL_ANGLE,
    all_cases,
    key,
    matrix,
)
from gcs_cli.experiments.paper.linear.tables import actuator_settings

# ---------------------------------------------------------------- verdicts


def case_entry(
    overshoot: float | None,
    rms_m: float = 0.1,
    how: str = "",
    steady_m: float = 0.0,
    yaw_percent: float = 0.0,
    later: float | None = None,
) -> dict[str, Any]:
    """A flight with a move of x and two of y; ``later`` overshoots that of the third move."""
    moves = [move_entry(1.0, overshoot)], [move_entry(3.0, overshoot), move_entry(7.0, later)]
    x, y = ({"moves": of, "steady_state_error": 0.0} for of in moves)
    path = dict.fromkeys(("max_error_m", "path_rms_m", "path_max_m", "beyond_m"), 0.1)
    return {
        "ended": {"time_s": 1.0, "why": "turned over", "how": how} if how else None,
        "path": {"rms_error_m": rms_m, **path},
        "metrics": {"x": {**x, "steady_state_error": steady_m}, "y": y, "z": {"max_error": 0.13}},
        "effort": {"saturated_percent": {"yaw": yaw_percent}},
    }


def move_entry(at_s: float, overshoot: float | None) -> dict[str, Any]:
    return {"at_s": at_s, "watched_s": 2.0, "by": 1.0, "overshoot_percent": overshoot}


def cases_with(**changed: dict[str, Any]) -> dict[str, Any]:
    """All cases of the comparison on the small-angle plant, alike but for those of the given contenders."""
    return {
        case.key: changed.get(case.key.split("/")[0], case_entry(20.0))
        for case in matrix(("smooth", "hard"), (SMALL_ANGLE,))
    }


def verdicts(cases: dict[str, Any]) -> dict[str, bool]:
    return {claim["name"]: claim["holds"] for claim in claims(cases, {})}


def test_verdicts_follow_the_figures() -> None:
    alike = verdicts(cases_with())
    assert alike == {
        "similar": True, "overshoot": False, "limits": False, "method": False, "torque": False, "survives": True,
    }  # fmt: skip
    assert verdicts(cases_with(backstepping=case_entry(18.9)))["overshoot"]
    assert not verdicts(cases_with(backstepping=case_entry(19.1)))["overshoot"]
    assert verdicts(cases_with(backstepping=case_entry(19.4)))["method"]
    assert not verdicts(cases_with(backstepping=case_entry(20.0, rms_m=0.089)))["similar"]
    assert not verdicts(cases_with(pid=case_entry(20.0, rms_m=0.089)))["similar"]
    assert verdicts(cases_with(pid=case_entry(20.0, steady_m=-0.01)))["torque"]


def test_table_2_is_judged_with_its_rate_fed_ahead_too() -> None:
    assert not verdicts(cases_with(rate_fed_pid=case_entry(20.0, rms_m=0.089)))["similar"]
    fed = cases_with(backstepping=case_entry(15.0), rate_fed_pid=case_entry(14.0))
    found = {claim["name"]: claim for claim in claims(fed, {})}
    assert not found["overshoot"]["holds"]
    assert not found["method"]["holds"]
    assert "14.0 % with its rate fed ahead" in found["overshoot"]["words"]


def test_only_moves_that_began_at_rest_with_all_are_compared() -> None:
    one, other = case_entry(20.0, later=80.0), case_entry(10.0)
    assert shared_overshoots([one, one]) == ([20.0, 20.0], [80.0, 80.0], 3)
    assert shared_overshoots([one, other]) == ([20.0, 10.0], [20.0, 10.0], 2)
    assert shared_overshoots([one, case_entry(None)]) is None
    found = {claim["name"]: claim for claim in claims(cases_with(pid=case_entry(None)), {})}
    assert not found["overshoot"]["holds"]
    assert "No move began at rest with all of them" in found["overshoot"]["words"]


@pytest.mark.parametrize(("how", "words"), [("crashed", "crashed"), ("lost", "lost control")])
def test_a_crash_is_told_and_decides_nothing_in_its_favour(how: str, words: str) -> None:
    found = {claim["name"]: claim for claim in claims(cases_with(backstepping=case_entry(1.0, how=how)), {})}
    assert not any(claim["holds"] for claim in found.values())
    assert (
        found["overshoot"]["words"] == f"Backstepping {words} on the small-angle plant: nothing to compare."
    )
    assert "the PID does not come to its end with: nothing" in found["survives"]["words"]
    assert f"({words})" in found["survives"]["words"]
    assert found["survives"]["words"].endswith("The PID with its rate fed ahead does not with: nothing.")


def test_an_advantage_that_ends_with_the_limits_alone_is_theirs() -> None:
    cases = cases_with(backstepping=case_entry(15.0))
    assert not verdicts(cases)["limits"]
    cases[key(BACKSTEPPING, "hard", "ideal")] = case_entry(19.5)  # without lag, too: not judged
    assert not verdicts(cases)["limits"]
    cases[key(BACKSTEPPING, "hard", "no_limits")] = case_entry(19.5)
    assert verdicts(cases)["limits"]
    cases[key(BACKSTEPPING, "hard", "plain")] = case_entry(19.5)
    assert not verdicts(cases)["limits"]  # nothing to explain


def linear_with(**backstepping: Any) -> dict[str, Any]:
    """An analysis in which both controllers are alike, but for these figures of backstepping's roll loop."""

    def loop(controller: str, changed: dict[str, Any]) -> dict[str, Any]:
        alike = {"gain_db": 10.0, "phase_deg": 40.0, "lowest_hz": 300.0}
        axes = {
            axis: {
                "sampled": [sampled(name, {**alike, **(changed if axis == "roll" else {})}) for name in named]
            }
            for axis, named in {"roll": FLOWN, "pitch": FLOWN, "yaw": (*FLOWN, *SPIN_UP)}.items()
        }
        return {"controller": controller, "gains": "paper", "axes": axes}

    return {"loops": [loop("pid", {}), loop("backstepping", backstepping)]}


FLOWN, SPIN_UP = ("motor lag",), ("motor lag with spin-up torque",)


def sampled(name: str, of: dict[str, Any]) -> dict[str, Any]:
    margins = {"gain_db": of["gain_db"], "phase_deg": of["phase_deg"]} if of["gain_db"] != "none" else None
    return {"actuators": name, "margins": {"1000": margins}, "lowest_stable_hz": of["lowest_hz"]}


@pytest.mark.parametrize(
    ("changed", "holds"),
    [
        ({}, True),
        ({"gain_db": 9.6, "phase_deg": 38.5, "lowest_hz": 310.0}, True),
        ({"gain_db": 9.4}, False),
        ({"phase_deg": 37.9}, False),
        ({"lowest_hz": 316.0}, False),
        ({"lowest_hz": None}, False),
        ({"gain_db": None, "phase_deg": None}, True),
        ({"gain_db": "none"}, False),
        ({"gain_db": 20.0, "phase_deg": 60.0, "lowest_hz": 200.0}, True),
    ],
)
def test_nearer_to_instability_is_told_by_margins_and_lowest_rates(
    changed: dict[str, Any], holds: bool
) -> None:
    found = [claim for claim in claims({}, linear_with(**changed)) if claim["name"] == "stable"]
    assert [claim["plant"] for claim in found] == [SMALL_ANGLE, RIGID]
    for claim in found:
        assert claim["holds"] is holds
        assert claim["words"].endswith("nearer in none." if holds else "nearer in roll.")


def test_the_analysis_has_what_the_claim_asks_for() -> None:
    for axis in ("roll", "pitch", "yaw"):
        names = {name for name, _ in actuator_settings(axis)}
        assert names.issuperset(FLOWN if axis != "yaw" else FLOWN + SPIN_UP)


def test_a_yaw_loop_that_saturates_is_told() -> None:
    (claim, *_) = claims(cases_with(pid=case_entry(20.0, yaw_percent=80.4)), {})
    assert claim["words"].endswith(
        "The yaw loop of the PID as flown is at the rotors' limits in 80 % of the time."
    )
    flights = {case.key: case_entry(20.0) for case in matrix(("desired",), (SMALL_ANGLE, RIGID))}
    (claim,) = claims(flights, {})
    assert claim["holds"]
    flights[key(PID, "desired", plant=RIGID)] = case_entry(20.0, yaw_percent=80.4)
    (claim,) = claims(flights, {})
    assert not claim["holds"]
    assert "80 % of the time on the rigid-body plant" in claim["words"]


@pytest.mark.parametrize(
    ("module", "name", "value"),
    [
        (claims_module, "SMOOTH", "smoth"),
        (claims_module, "IDEAL", "idel"),
        (claims_module, "PID", "pdi"),
        (claims_stability, "DESIRED", "smooth_"),
        (claims_stability, "_FLOWN", "motor lagg"),
    ],
)
def test_a_verdict_is_never_dropped_by_a_typo(
    monkeypatch: pytest.MonkeyPatch, module: Any, name: str, value: str
) -> None:
    cases = {case.key: case_entry(20.0) for case in all_cases(multibody=False)}
    assert len(claims(cases, linear_with())) == 2 * 7 + 1
    monkeypatch.setattr(module, name, value)
    with pytest.raises((KeyError, ValueError)):
        claims(cases, linear_with())


@pytest.mark.parametrize("path", [("path", "rms_error_m"), ("effort", "saturated_percent"), ("metrics", "x")])
def test_a_figure_that_a_flight_lacks_is_an_error(path: tuple[str, str]) -> None:
    cases = {case.key: case_entry(20.0) for case in all_cases(multibody=False)}
    for case in cases.values():
        del case[path[0]][path[1]]
    with pytest.raises(KeyError, match=path[1]):
        claims(cases, linear_with())


def test_a_condition_that_a_plant_does_not_fly_is_no_missing_flight() -> None:
    with pytest.raises(KeyError):
        flight({}, key(PID, "smooth", "drive", SMALL_ANGLE))
    with pytest.raises(NotFlownError):
        flight({}, key(PID, "smooth", "drive", RIGID))
    with pytest.raises(ValueError, match="'driv' is none of"):
        key(PID, "smooth", "driv")


def test_a_table_without_flights_is_empty() -> None:
    assert claims({}, {}) == []
    assert comparisons.xy({}) == {}


def test_the_table_in_xy_has_none_for_a_crash() -> None:
    table = comparisons.xy(cases_with(poles=case_entry(20.0, how="crashed")))["hard"][SMALL_ANGLE]["plain"]
    assert table[POLES] is None
    assert table[PID]["overshoot_percent"] == 20.0
