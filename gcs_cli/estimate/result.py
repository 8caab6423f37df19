"""Figures of an estimate: differences to the log's own estimate and to truth, consistency of the innovations."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from flightstack.estimation.error_state import ATTITUDE, POSITION, VELOCITY
from flightstack.estimation.kalman import (
    BARO,
    GNSS_POSITION,
    GNSS_VELOCITY,
    MAG,
)
from gcs_cli.charts.pages import render_page, shown
from gcs_cli.estimate.charts import figures
from gcs_cli.estimate.run import Estimate, run
from gcs_cli.estimate.track import (
    Differences,
    Track,
    differences,
    errors_at,
    flight_span,
    logged_track,
    summary_of,
)
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
_PARTS = (("attitude", ATTITUDE), ("velocity", VELOCITY), ("position", POSITION))
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
            "consistency": consistency(self.estimate, self.others.get(TRUTH), span),
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


def consistency(
    estimate: Estimate, truth: Track | None, span_s: tuple[float, float] | None
) -> dict[str, float | None]:
    """Return figures that are 1 for a consistent filter, and the share of refused measurements of each sensor.

    NIS: mean of the squares of accepted innovations by their variance, over all measurements. NEES: mean of the squares
    of the errors against truth by their covariance, by their number; None without truth.
    """
    found: dict[str, float | None] = {}
    for name, row, count in _SENSORS:
        last = estimate.observations[-1, row : row + count]
        fused, refused = float(np.sum(last["fused"])), float(np.sum(last["refused"]))
        found[f"{name}_nis"] = float(np.sum(last["nis_sum"])) / fused if fused else None
        found[f"{name}_refused_share"] = refused / (fused + refused) if fused + refused else None
    return {**found, **_nees(estimate, truth, span_s)}


def _nees(
    estimate: Estimate, truth: Track | None, span_s: tuple[float, float] | None
) -> dict[str, float | None]:
    found: dict[str, float | None] = dict.fromkeys((f"{name}_nees" for name, _ in _PARTS), None)
    if truth is None:
        return found
    x, begin_s, end_s = estimate.nominal, *(span_s or (-np.inf, np.inf))
    state = Track(estimate.state_s, x[:, :4], estimate.state_s, x[:, 4:7], x[:, 7:10], estimate.track.origin)
    errors = errors_at(state, truth)
    known = np.flatnonzero(np.isfinite(errors).all(axis=1))
    if known.size:  # the filter's height is that above the start: the error of the first fix is none of it
        errors[:, POSITION + 2] -= errors[known[0], POSITION + 2]
    inside = (estimate.state_s >= begin_s) & (estimate.state_s <= end_s)
    for name, at in _PARTS:
        e, p = errors[:, at : at + 3], estimate.covariance[:, at : at + 3, at : at + 3]
        used = inside & np.isfinite(e).all(axis=1)
        if used.any():
            squares = np.einsum("ni,ni->n", e[used], np.linalg.solve(p[used], e[used, :, None])[:, :, 0])
            found[f"{name}_nees"] = float(np.mean(squares)) / 3.0
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
