"""Figures of an estimate: differences to the log's own estimate and to truth, consistency of the innovations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    GNSS_VELOCITY,
    INNOVATION,
    INNOVATION_VARIANCE,
    MAG,
)
from gcs_cli.charts.pages import render_page, shown
from gcs_cli.estimate.charts import figures
from gcs_cli.estimate.run import Estimate, run
from gcs_cli.estimate.track import Differences, Track, differences, flight_span, logged_track, summary_of
from gcs_cli.logs.recording import Recording

TEMPLATES = Path(__file__).parent / "templates"
OWN, TRUTH, OWN_TO_TRUTH = "log's estimate", "truth", "log's estimate to truth"
KEYS = {OWN: "to_log", TRUTH: "to_truth", OWN_TO_TRUTH: "log_to_truth"}
_SENSORS = (
    ("gnss_velocity", GNSS_VELOCITY, 3),
    ("gnss_position", GNSS_POSITION, 3),
    ("mag", MAG, 3),
    ("baro", BARO, 1),
)
_COLUMNS = (
    ("roll", "deg", "°"),
    ("pitch", "deg", "°"),
    ("tilt", "deg", "°"),
    ("yaw", "deg", "°"),
    ("velocity_horizontal", "m_s", " m/s"),
    ("velocity_vertical", "m_s", " m/s"),
    ("position_horizontal", "m", " m"),
    ("position_vertical", "m", " m"),
)


@dataclass(frozen=True, eq=False)
class Result:
    """An estimate and its differences, by the name of the other estimate."""

    estimate: Estimate
    others: dict[str, Track]
    against: dict[str, Differences]
    in_air_s: tuple[float, float] | None
    """Time of the flight; None for a vehicle that stayed on the ground: then all of the log counts."""

    @property
    def summary(self) -> dict[str, Any]:
        """Figures with units in their names; None where the log has no reference."""
        span = self.in_air_s
        return {
            "in_air_s": None if span is None else round(span[1] - span[0], 3),
            **{key: self._figures(name) for name, key in KEYS.items()},
            "consistency": consistency(self.estimate),
            "samples": self.estimate.samples,
        }

    def _figures(self, name: str) -> dict[str, float | None] | None:
        found = self.against.get(name)
        return None if found is None else summary_of(found)


def estimate_log(log: Recording, given: Mapping[str, float] = MappingProxyType({})) -> Result:
    """Run the filter over a log, with parameters ``given`` by name, and compare it.

    Raise CliError if the log's sensors do not suffice.
    """
    estimate = run(log, given)
    others = {OWN: logged_track(log), TRUTH: logged_track(log, "_groundtruth")}
    known = {name: track for name, track in others.items() if track is not None}
    reference = known.get(TRUTH, known.get(OWN, estimate.track))
    span = flight_span(reference)
    begin_s, end_s = span or (-np.inf, np.inf)
    against = {name: differences(estimate.track, track, begin_s, end_s) for name, track in known.items()}
    if len(known) == 2:
        against[OWN_TO_TRUTH] = differences(known[OWN], known[TRUTH], begin_s, end_s)
    return Result(estimate, known, against, span)


def consistency(estimate: Estimate) -> dict[str, float | None]:
    """Return the mean of each sensor's squared innovations by their variance, 1 for a consistent filter."""
    found: dict[str, float | None] = {}
    for name, row, count in _SENSORS:
        values = estimate.observations[:, row : row + count]
        variance = values[:, :, INNOVATION_VARIANCE]
        used = variance > 0.0
        ratios = np.square(values[:, :, INNOVATION][used]) / variance[used]
        found[f"{name}_nis"] = float(np.mean(ratios)) if len(ratios) else None
    return found


def rows_of(summary: Mapping[str, Any]) -> Iterator[tuple[str, list[str]]]:
    """Yield the name of each comparison, and its figures as text: root mean square (largest)."""
    for name, key in KEYS.items():
        figures_of = summary[key]
        if figures_of is None:
            continue
        cells = []
        for quantity, unit, suffix in _COLUMNS:
            rms, largest = (figures_of[f"{quantity}_{part}_{unit}"] for part in ("rms", "max"))
            cells.append(f"{shown(rms, '.2f')} ({shown(largest, '.2f')}){suffix}")
        yield name, cells


def quantities() -> list[str]:
    """Return the titles of the columns of ``rows_of``."""
    return [name.replace("_", " ") for name, _, _ in _COLUMNS]


def render(result: Result, log: Recording) -> str:
    """Return the report as HTML."""
    summary = result.summary
    span = summary["in_air_s"]
    return render_page(
        TEMPLATES,
        "estimate.html",
        title=Path(log.source).name,
        lines=[str(log.info.get("sys_name", "")), f"{log.duration_s:.1f} s"],
        quantities=quantities(),
        comparisons=list(rows_of(summary)),
        span="in all of the log" if span is None else f"in the air ({span:.1f} s)",
        figures=list(figures(result.estimate, result.others, result.against)),
        facts=[(name, str(count)) for name, count in sorted(summary["samples"].items())]
        + [
            (f"{name.replace('_', ' ')}", shown(value, ".2f"))
            for name, value in summary["consistency"].items()
        ],
    )
