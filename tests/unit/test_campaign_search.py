"""The search of ``gcs campaign --seek worst`` on functions whose boundary is known, and the report of a campaign."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest

from flightstack.core.contract import FloatArray
from flightstack.core.errors import ConfigError
from flightstack.testing.expectations import Check
from gcs_cli.campaign.definition import Campaign, load_campaign
from gcs_cli.campaign.figures import map_figure, margin_figure, metric_figure
from gcs_cli.campaign.options import CampaignOptions
from gcs_cli.campaign.page import render_campaign
from gcs_cli.campaign.plan import plan_flights
from gcs_cli.campaign.rows import Row, row_of
from gcs_cli.campaign.search import HALVINGS, Flown, box_ends, fewest_flights, search
from gcs_cli.campaign.seek import nominal_point
from gcs_cli.scenarios.result import Result
from tests.support.parsed_page import own_part

EXAMPLE = Path(__file__).parents[2] / "examples/campaigns/hop_in_gusts.toml"


class World:
    """Flies points by a function, and counts them."""

    def __init__(self, robustness: Callable[[FloatArray], float]) -> None:
        self.robustness = robustness
        self.count = 0

    def fly(self, points: Sequence[FloatArray]) -> list[Flown]:
        found = []
        for point in points:
            assert ((point >= 0.0) & (point <= 1.0)).all()
            self.count += 1
            margin = self.robustness(point)
            found.append(Flown(point, margin, margin >= 0.0, self.count))
        return found


def test_search_finds_the_least_margin_and_the_boundary() -> None:
    centre = np.array([0.8, 0.3])
    world = World(lambda point: 4.0 * math.dist(point, centre) - 0.8)  # fails within 0.2 of the centre
    found = search(world.fly, np.array([0.1, 0.3]), 300, 1)
    assert world.count == len(found.flown)
    assert found.worst.robustness == pytest.approx(-0.8, abs=0.1)  # within 0.025 of the centre; found 0.005
    assert found.smallest is not None
    assert found.size(found.smallest) == pytest.approx(0.5, abs=0.02)  # the boundary is at 0.5 from the start
    assert found.size(found.smallest) >= 0.5


@pytest.mark.parametrize("inputs", [1, 2, 3])
def test_each_input_alone_is_halved_to_its_boundary(inputs: int) -> None:
    world = World(lambda point: 0.7 - float(point.max()))
    found = search(world.fly, np.zeros(inputs), 100, 1)
    for index in range(inputs):
        rays = found.alone(index)
        assert rays
        for ray in rays:
            low, high = ray.passes.point[index], ray.fails.point[index]
            assert low <= 0.7 < high
            assert high - low <= 0.5**HALVINGS


@pytest.mark.parametrize("inputs", [1, 2, 3, 10])
@pytest.mark.parametrize("flights", [20, 40, 70, 200])
@pytest.mark.parametrize("limit", [0.01, 0.7])
def test_search_flies_no_more_than_its_flights(inputs: int, flights: int, limit: float) -> None:
    start = np.full(inputs, 0.5)
    flights = max(flights, fewest_flights(start))
    world = World(lambda point: limit - abs(float(point.max()) - 0.5))
    found = search(world.fly, start, flights, 1)
    assert len(found.flown) == world.count <= flights


@pytest.mark.parametrize("start", [(0.0, 0.0), (0.0, 1.0), (0.5, 0.0), (0.5, 0.5)])
def test_search_flies_the_end_of_each_ray_once(start: tuple[float, float]) -> None:
    corners = [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0), (1.0, 1.0)]
    middles = [(0.0, start[1]), (1.0, start[1]), (start[0], 0.0), (start[0], 1.0)]
    ends = [tuple(end) for end in box_ends(np.array(start))]
    assert sorted(ends) == sorted({*corners, *middles} - {start})


def test_search_is_the_same_each_time() -> None:
    flown = []
    for _ in range(2):
        world = World(lambda point: 0.7 - float(point.sum()))
        flown.append([tuple(each.point) for each in search(world.fly, np.zeros(2), 80, 3).flown])
    assert flown[0] == flown[1]


def test_a_search_without_failures_has_no_boundary() -> None:
    found = search(World(lambda point: 1.0 - 0.5 * float(point[0])).fly, np.zeros(2), 60, 1)
    assert (found.smallest, list(found.rays)) == (None, [])
    assert found.worst.robustness == pytest.approx(0.5, abs=1e-12)  # at the end of the range


def test_a_search_whose_start_fails_flies_once() -> None:
    found = search(World(lambda point: -1.0).fly, np.zeros(2), 60, 1)
    assert len(found.flown) == 1
    assert found.smallest == found.nominal


def campaign(folder: Path, vary: str) -> Campaign:
    head = "plan = 'hop'\n[[event]]\nat_s = 2\nlink = 'delay {late}'\n[expect]\n[campaign]\n[vary]\n"
    (folder / "c.toml").write_text(head + vary)
    return load_campaign(folder / "c.toml")


def test_search_starts_where_nothing_varies(tmp_path: Path) -> None:
    found = campaign(
        tmp_path,
        "late = {uniform = [0, 2], nominal = 0.5}\nsimulated.body.mass_kg = {uniform = [0.5, 0.6]}",
    )
    assert nominal_point(found) == pytest.approx([0.25, 0.5])


@pytest.mark.parametrize(
    ("vary", "sentence"),
    [
        ("late = {uniform = [0, 2]}", "vary.late.nominal: is missing: --seek worst searches from there"),
        ("late = {choice = [0, 2]}", "vary.late: is a choice: --seek worst searches ranges"),
        (
            "late = {uniform = [1, 2], nominal = 0.5}",
            "vary.late: 0.5, from which --seek worst searches, is outside the range 1 to 2: give another range, or "
            "nominal",
        ),
        (
            "simulated.body.mass_kg = {normal = [0.7, 0.1], low = 0.65}",
            "mass_kg: 0.55, from which .* 0.65 to inf",
        ),
    ],
)
def test_inputs_without_range_or_start_are_not_searched(tmp_path: Path, vary: str, sentence: str) -> None:
    found = campaign(tmp_path, vary)
    with pytest.raises(ConfigError, match=sentence):
        nominal_point(found)


def rows_of(found: Campaign) -> list[Row]:
    rows = []
    for flight in plan_flights(found):
        margin = 0.4 - 0.2 * float(flight.inputs["wind.gust_m_s"])
        check = Check("max_error_m ≤ 0.6", margin >= 0.0, "…", margin, 0.6)
        rows.append(
            row_of(
                flight, Result((check,), None, "completed", "", 4.0, metrics={"max_error_m": 0.6 - margin})
            )
        )
    return rows


def test_report_shows_probability_sensitivity_and_the_command_of_the_worst_flight() -> None:
    found = load_campaign(EXAMPLE)
    rows = rows_of(found)
    page = own_part(render_campaign(found, rows, CampaignOptions(EXAMPLE)))
    failed = sum(not row["passed"] for row in rows)
    worst = min(rows, key=lambda row: row["robustness"])
    assert f"{failed} of 40 failed" in page
    assert f"{100.0 * (40 - failed) / 40:.1f} %" in page
    assert f"gcs campaign {EXAMPLE} --only {worst['flight']}" in page
    assert '<td>wind.gust_m_s</td><td class="n">-1.00</td>' in page  # rank correlation with the gusts
    assert page == own_part(render_campaign(found, rows, CampaignOptions(EXAMPLE)))


def test_figures_hold_every_flight() -> None:
    rows = rows_of(load_campaign(EXAMPLE))
    (margin,) = margin_figure(rows).panels
    assert sum(margin.bars[0].heights) == 40
    assert [panel.x.label for panel in metric_figure(rows).panels] == ["max error"]
    (boundary,) = map_figure(rows, "wind.gust_m_s", "simulated.body.mass_kg", rows[:2]).panels
    assert {series.name: len(series.x) for series in boundary.series}["boundary"] == 2
    assert sum(len(series.x) for series in boundary.series) == 42
