"""Verdicts on the page of the paper: the figures that decide, plants that differ, what is undecided."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.printed import print_results
from gcs_cli.experiments.paper.report import tables
from gcs_cli.experiments.paper.report.labels import LABELS
from gcs_cli.experiments.paper.report.tables import Table
from gcs_cli.experiments.paper.report.verdicts import Verdict, verdicts
from tests.support.paper_flights import (
    linear_part,
    onset_part,
    pil_part,
    small_results,
)


def all_results() -> dict[str, Any]:
    return small_results() | {"linear": linear_part(), "onset": onset_part(), "pil": pil_part()}


def texts(table: Table) -> list[list[str]]:
    return [[cell if isinstance(cell, str) else cell.text for cell in row] for row in table.rows]


def verdict_on(results: dict[str, Any], claim: str) -> Verdict:
    return next(one for one in verdicts(results) if claim in one.claim)


def test_verdict_depends_on_the_plant_where_the_plants_differ() -> None:
    results = small_results()
    claim = {"claim": "it is so", "source": "paper, IV.B", "words": "By 1 %.", "threshold": "", "figures": {}}
    results["comparisons"]["claims"] = [
        {**claim, "name": "a", "plant": cases.SMALL_ANGLE, "holds": True},
        {**claim, "name": "a", "plant": cases.RIGID, "holds": False},
        {**claim, "name": "b", "claim": "all", "plant": cases.RIGID, "holds": True},
        {**claim, "name": "c", "claim": "none", "plant": cases.RIGID, "holds": False},
    ]
    assert verdict_on(results, "it is so")[2:4] == (None, "holds on small-angle only")
    assert verdict_on(results, "all")[2:4] == (True, "holds")
    assert verdict_on(results, "none")[2:4] == (False, "does not hold")


def test_verdict_states_the_figures_that_decide_it() -> None:
    results = all_results()
    claim = {"claim": "alike", "source": "paper, IV.B", "plant": cases.SMALL_ANGLE, "holds": False}
    figures = {"pid_m": 0.0178, "rate_fed_pid_m": 0.0105, "backstepping_m": 0.0169}
    alike = {**claim, "name": "similar", "figures": figures}
    results["comparisons"]["claims"] = [
        alike,
        {**claim, "name": "stable", "claim": "near", "figures": {"nearer": ["roll"]}},
    ]
    assert "small-angle 17.8, 10.5, 16.9 mm" in verdict_on(results, "alike").figures
    assert "small-angle: roll" in verdict_on(results, "near").figures


def test_verdict_on_the_target_is_that_of_the_bits() -> None:
    results = all_results()
    assert verdict_on(results, "target").verdict == "holds on an emulated Cortex-M4F"
    assert "0.477 µm" in verdict_on(results, "target").figures
    results["pil"]["controllers"]["pid"]["differences"][1]["largest"] = 1e-9
    assert verdict_on(results, "target").ok is False


def plants_part(within: bool, decides: bool = True) -> dict[str, Any]:
    found = {
        "max_position_m": 0.0021, "rms_position_m": 0.001, "max_attitude_deg": 0.123, "rms_attitude_deg": 0.05,
        "position_bound_m": 0.01, "attitude_bound_deg": 0.5, "within_bounds": within,
        "bound_decides": decides, "rounding": {"max_position_m": 1e-9 if decides else 0.0028},
    }  # fmt: skip
    return {"rigid_multibody": {cases.PID: found}}


@pytest.mark.parametrize("within", [True, False])
def test_models_agree_if_the_plants_stay_within_their_bounds(within: bool) -> None:
    results = small_results()
    results["plants"] = plants_part(within)
    found = verdict_on(results, "model agree")
    assert found.ok is within
    assert "2.10 mm, 0.123°" in found.figures
    assert texts(tables.plants_table(results["plants"]))[0][:4] == [
        "PID",
        "2.10",
        "0.123",
        "yes" if within else "no",
    ]


def test_plants_are_undecided_where_a_loop_amplifies_rounding() -> None:
    results = small_results()
    results["plants"] = plants_part(True, decides=False)
    assert texts(tables.plants_table(results["plants"]))[0][3] == "undecided"
    assert not [one for one in verdicts(results) if "model agree" in one.claim]


@pytest.mark.parametrize("decides", [True, False])
def test_terminal_names_a_difference_of_plants_that_is_chance(decides: bool) -> None:
    results = small_results()
    results["plants"] = plants_part(True, decides)
    terminal = Console(file=io.StringIO(), width=200)
    print_results(terminal, results, Path("here"))
    text = terminal.file.getvalue()  # type: ignore[attr-defined]
    assert (
        f"rigid body against multibody, {results['contenders'][cases.PID]['label']}: at most 2.1 mm" in text
    )
    assert ("a push of 10⁻¹² N moves it by 2.8 mm on one plant alone" in text) is not decides
    assert "results in here" in text
    assert LABELS[cases.PID] in text
