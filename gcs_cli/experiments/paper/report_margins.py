"""Margins and lowest rates of all loops as tables of the report: as flown first, then as the paper's computer. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

from gcs_cli.experiments.paper.report_labels import (
    ANGLES,
    AXIS_TITLES,
    UNKNOWN,
    anchored,
    cell,
    fixed,
    number,
    row,
    wide_table,
)
from gcs_cli.experiments.paper.report_lag import beyond_note
from gcs_cli.experiments.paper.report_onset import loop_title
from gcs_cli.report.plots import section

Loops = Sequence[Mapping[str, Any]]

FLOWN, SPIN_UP, DELAYED = "motor lag", "motor lag with spin-up torque", "ideal rotors, one step of delay"
"""Names of actuators in the results."""
SPIN_UP_TITLE = f"{AXIS_TITLES['yaw']} with spin-up torque"
FLOWN_RATES = "1000/250"
_CUT = (
    "Each loop is cut at one place, where its law hands a demand on: the angular acceleration about an axis, before "
    "mixer and rotors. Angle and rate are fed back together; all else is at rest. Gain margin, then phase margin."
)


def margin_sections(linear: Mapping[str, Any]) -> Iterator[str]:
    """Yield the margins of the attitude loops, as flown and with a step of delay, and those of x, y and z."""
    loops: Loops = linear["loops"]
    lag = f"{fixed(1e3 * linear['motor_lag_s'], 0)} ms"
    note = (
        f"{_CUT} Motors of {lag}, answered in the tick that reads the state: so it flies, at 1000 Hz; at the other "
        "inner rates it would. The torque by which rotors react to being spun up is in the rigid body and the "
        "multibody assembly, and not in the small-angle model. Unstable: no margin."
    )
    yield anchored(
        "margins", section("Margins of the attitude loops as flown", flown_table(loops), note=note)
    )
    note = (
        f"{_CUT} Ideal rotors, and a step of delay for a computer that needs the tick to compute: nothing in this "
        "report flies so, but the simulated onset below. ωn and ζ are what the proportional and the derivative gain "
        "alone would place; ζ above 1: two real poles. Motor lag borne: what ends stability at 1000 Hz without delay."
    )
    note = f"{note} {beyond_note(loops)}".rstrip()
    title = "Margins with ideal rotors and one step of delay"
    yield anchored("margins-delayed", section(title, delayed_table(loops), note=note))
    note = (
        "Cut at the acceleration that the outer loop asks for, once in each outer period, with attitude loop, "
        f"reference filter and motors of {lag} inside; inner loop at 1000 Hz, outer loop at 250 Hz. The step is one "
        "of the setpoint without its rate, in continuous time and with ideal rotors. Lowest rate: of the outer loop, "
        "with the inner one left at 1000 Hz."
    )
    yield anchored("margins-outer", section("Margins of x, y and z as flown", outer_table(loops), note=note))


def own_feedback(loops: Loops, axis: str) -> list[Mapping[str, Any]]:
    """Return the loops without those whose feedback on an axis is that of one before: a feed-forward moves no pole."""
    found: dict[tuple[float, ...], Mapping[str, Any]] = {}
    for loop in loops:
        law = loop["axes"][axis]["gains"]
        found.setdefault((law["kp"], law["ki"], law["kd"]), loop)
    return list(found.values())


def flown_table(loops: Loops) -> str:
    """Return the margins of each attitude axis with motors that lag, yaw also with the spin-up torque."""
    rows = []
    for axis, actuators, title in (
        *((axis, FLOWN, AXIS_TITLES[axis]) for axis in ANGLES),
        ("yaw", SPIN_UP, SPIN_UP_TITLE),
    ):
        for index, loop in enumerate(own_feedback(loops, axis)):
            of = sampled(loop["axes"][axis], actuators)
            if of is not None:
                rows.append(row(f"{_head(title, loop, index)}{_margin_cells(of)}{_lowest(of)}", not index))
    return wide_table(("axis", "controller", *_rate_heads(loops), "#lowest stable rate"), rows)


def delayed_table(loops: Loops) -> str:
    """Return natural frequency, damping, poles, margins and the largest motor lag of each attitude axis."""
    rows = []
    for axis in ANGLES:
        for index, loop in enumerate(own_feedback(loops, axis)):
            whole = loop["axes"][axis]
            of = sampled(whole, DELAYED)
            if of is None:
                continue
            mode = cell(fixed(whole["natural_rad_s"], 1)) + cell(fixed(whole["damping"], 2))
            poles = f"<td>{escape(_poles(whole['poles']))}</td>"
            cells = f"{mode}{poles}{_margin_cells(of)}{_lowest(of)}{_lag_cell(whole)}"
            rows.append(row(f"{_head(AXIS_TITLES[axis], loop, index)}{cells}", not index))
    ends = ("#lowest stable rate", "#motor lag borne")
    columns = ("axis", "controller", "#ωn [rad/s]", "#ζ", "poles [1/s]", *_rate_heads(loops), *ends)
    return wide_table(columns, rows)


def outer_table(loops: Loops) -> str:
    """Return slowest pole, step response, margins and lowest outer rate of x, y and z."""
    rows = []
    for axis in ("x", "y", "z"):
        for index, loop in enumerate(loops):
            whole = loop["axes"][axis]
            of = sampled(whole, FLOWN)
            if of is None:
                continue
            slowest, step = whole["slowest"], whole["step"]
            mode = cell(fixed(slowest["natural_rad_s"], 2)) + cell(fixed(slowest["damping"], 2))
            over = cell(_with(fixed(step["overshoot_percent"] if step else None, 1), "%"))
            settling = cell(_with(fixed(step["settling_s"] if step else None, 2), "s"))
            margins = _margin_cell(of["margins"].get(FLOWN_RATES))
            lowest = cell(_with(fixed(of["lowest_stable_outer_hz"], 2), "Hz"))
            rows.append(
                row(
                    f"{_head(AXIS_TITLES[axis], loop, index)}{mode}{over}{settling}{margins}{lowest}",
                    not index,
                )
            )
    columns = (
        *("axis", "controller", "#slowest pole: ωn [rad/s]", "#ζ", "#step: overshoot", "#settling 2 %"),
        *("#margins", "#lowest stable rate"),
    )
    return wide_table(columns, rows)


def sampled(of: Mapping[str, Any], actuators: str) -> Mapping[str, Any] | None:
    """Return what the sampled analysis of an axis says of these actuators; None if it was not asked."""
    found: Mapping[str, Any] | None = next(
        (entry for entry in of["sampled"] if entry["actuators"] == actuators), None
    )
    return found


def _head(title: str, loop: Mapping[str, Any], index: int) -> str:
    return f"<th>{escape(title) if not index else ''}</th><td>{escape(loop_title(loop))}</td>"


def _rate_heads(loops: Loops) -> list[str]:
    of = sampled(loops[0]["axes"]["roll"], FLOWN) or loops[0]["axes"]["roll"]["sampled"][0]
    return [f"#{rate} Hz" for rate in of["margins"]]


def _margin_cells(of: Mapping[str, Any]) -> str:
    return "".join(_margin_cell(margins) for margins in of["margins"].values())


def _margin_cell(margins: Mapping[str, Any] | None) -> str:
    if margins is None:
        return '<td class="n bad">unstable</td>'
    gain, phase = fixed(margins["gain_db"], 1), fixed(margins["phase_deg"], 0)
    gain_text = "any gain" if gain == UNKNOWN else f"{gain} dB"
    phase_text = "any phase" if phase == UNKNOWN else f"{phase}°"
    return cell(f"{gain_text}, {phase_text}")


def _lowest(of: Mapping[str, Any]) -> str:
    return cell(_with(fixed(of["lowest_stable_hz"], 1), "Hz"))


def _with(shown: str, unit: str) -> str:
    return shown if shown == UNKNOWN else f"{shown} {unit}"


def _lag_cell(of: Mapping[str, Any]) -> str:
    lag_s = of["largest_lag_s"]
    return cell("any" if lag_s is None else f"{fixed(1e3 * lag_s, 1)} ms")


def _poles(poles: Sequence[Sequence[float]]) -> str:
    told = []
    for real, imaginary in poles:
        if imaginary < 0.0:
            continue  # told with its conjugate
        told.append(number(real) if imaginary == 0.0 else f"{number(real)} ± {number(imaginary)} j")
    return ", ".join(told)
