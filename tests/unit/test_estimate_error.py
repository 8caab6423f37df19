"""Errors of the estimate in a flight's report: known errors, bands, and flights on the true state."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from flightstack.core.contract import FloatArray
from flightstack.plan import Plan
from gcs_cli.report.estimate_error import estimate_error_figures, estimate_errors, estimate_figures
from gcs_cli.report.flight_charts import time_figures
from gcs_cli.report.flight_data import Flight, Series, series
from gcs_cli.report.path_charts import map_figure, space_figure
from tests.support.written_flights import armed_from, samples

SPAN = (0.0, 10.0)
TIMES = np.linspace(0.0, 10.0, 101)


def constant(*values: float) -> Series:
    rows: FloatArray = np.tile(values, (len(TIMES), 1))
    return series(TIMES.copy(), rows)


@pytest.fixture
def flight() -> Flight:
    """Return a flight with constant errors: 2° of roll, 3° of yaw across south, 0.5 m/s east, 1 m north, 2 m up."""
    degree = math.radians(1.0)
    return replace(
        Flight(duration_s=10.0, statuses=armed_from(0.0), landed=((0.0, False),)),
        position=constant(1.0, 0.0, -12.0),
        velocity=constant(0.0, 0.5, 0.0),
        attitude=constant(2.0 * degree, 0.0, -179.0 * degree),
        true_position=constant(0.0, 0.0, -10.0),
        true_velocity=constant(0.0, 0.0, 0.0),
        true_attitude=constant(0.0, 0.0, 178.0 * degree),
        deviations=constant(*[degree] * 3, *[0.2] * 3, *[0.4] * 3),
    )


def test_errors_are_estimate_minus_truth(flight: Flight) -> None:
    errors = estimate_errors(flight)
    assert errors.tilt_deg == pytest.approx(2.0)
    assert errors.yaw_deg == pytest.approx(3.0)
    assert errors.velocity_m_s[5] == pytest.approx([0.0, 0.5, 0.0])
    assert errors.position_m[5] == pytest.approx([1.0, 0.0, -2.0])


def test_figures_of_errors_count_the_flight_only(flight: Flight) -> None:
    found = estimate_figures(flight)
    assert found is not None
    assert (found["rms_yaw_deg"], found["max_height_m"]) == pytest.approx((3.0, 2.0))
    assert found["rms_horizontal_m"] == pytest.approx(1.0)
    assert estimate_figures(replace(flight, landed=((0.0, True),))) is None


def test_chart_of_errors_has_three_sigma(flight: Flight) -> None:
    (figure,) = estimate_error_figures(flight)
    assert [panel.y.label for panel in figure.panels] == ["tilt", "yaw", "velocity", "position"]
    bands = [[curve.y[0] for curve in panel.series if curve.name == "3σ"] for panel in figure.panels]
    assert bands[0] == pytest.approx([3.0 * math.sqrt(2.0)])
    assert bands[1:] == [pytest.approx([size, -size]) for size in (3.0, 0.6, 1.2)]


def test_true_path_is_drawn_beside_the_estimated_one(flight: Flight) -> None:
    space = space_figure(flight, Plan([]), SPAN)
    assert {"estimated path", "true path"} <= {path.name for path in space.paths}
    curves = {curve.name: curve for curve in map_figure(flight, Plan([]), SPAN).panels[0].series}
    assert (curves["estimated path"].y[0], curves["true path"].y[0]) == (1.0, 0.0)
    altitude = {curve.name: curve.y[0] for curve in time_figures(flight)[0].panels[2].series}
    assert altitude["truth"] == 10.0
    assert altitude["3σ"] == pytest.approx(12.0 - 1.2)


def test_flight_on_the_true_state_has_no_errors_of_an_estimate() -> None:
    flight = Flight(position=samples([0.0, 1.0], [[0.0] * 3] * 2), duration_s=10.0, statuses=armed_from(0.0))
    assert estimate_error_figures(flight) == []
    assert estimate_figures(flight) is None
    assert "flown" in {path.name for path in space_figure(flight, Plan([]), SPAN).paths}
