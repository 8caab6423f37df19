"""The linear analysis as parts of the report: poles, Bode plots and margins. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from gcs_cli.paper.linear.gains import AttitudeGains
from gcs_cli.paper.linear.margins import response
from gcs_cli.paper.linear.sampled import Actuators, AttitudeTick
from gcs_cli.paper.report_axes import Axis, Guide, chart, spanning
from gcs_cli.paper.report_curves import Mark
from gcs_cli.paper.report_flights import STEP_SIZE
from gcs_cli.paper.report_labels import (
    ANGLES,
    AXES,
    AXIS_TITLES,
    STYLES,
    UNKNOWN,
    anchored,
    cell,
    fixed,
    number,
    row,
    wide_table,
)
from gcs_cli.paper.report_onset import loop_name, loop_title, onset_section
from gcs_cli.report_chart import Line
from gcs_cli.report_plots import section

SHOWN_ACTUATORS = "ideal rotors, one step of delay"
BODE_HZ = 1000.0
_LEAST_SPAN = 4.0  # /s: of a pole map whose poles are all real
_POINTS = 360
_LOWEST_RAD_S = 1.0


Loops = Sequence[Mapping[str, Any]]


def linear_sections(linear: Mapping[str, Any], onset: Sequence[Mapping[str, Any]], why: str) -> Iterator[str]:
    """Yield the sections; one with the sentence ``why`` if the analysis was left out."""
    if not linear:
        yield anchored("linear", section("Linear analysis", f'<p class="none">Left out: {escape(why)}</p>'))
        return
    loops: Loops = linear["loops"]
    legend = [(loop_title(loop), _style(loop), False) for loop in loops]
    poles = "".join(_pole_map(loops, axis) for axis in AXES)
    note = (
        "Continuous loops at hover. Attitude: feedback alone, without feed-forward and integral of the outer loop. x "
        "and y: with reference filter and attitude loop inside. The linear PD has backstepping's poles by "
        "construction; the paper's controllers share one height loop. Pointing at a cross shows its numbers."
    )
    body = f'<div class="pair">{poles}</div>'
    yield anchored("linear", section("Linear analysis: poles", body, legend, note))
    bode = "".join(_bode(loops, axis) for axis in ANGLES)
    note = (
        f"Open attitude loops as they are computed: sampled at {BODE_HZ:g} Hz, held, with one step of delay and ideal "
        "rotors. Gain margin: where the phase crosses −180°. Phase margin: where the gain crosses 0 dB."
    )
    title = "Linear analysis: open loops"
    yield anchored("bode", section(title, f'<div class="pair">{bode}</div>', legend, note))
    yield anchored("margins", section("Linear analysis: margins", margins_table(loops), note=_MARGINS_NOTE))
    yield onset_section(onset)


_MARGINS_NOTE = (
    f"Sampled loops, {SHOWN_ACTUATORS}; gain margin and phase margin at each inner rate [Hz]. Unstable: no margin. "
    "ωn and ζ are what the proportional and derivative gain alone would place; ζ above 1: two real poles. Motor lag "
    f"borne: what ends stability at {BODE_HZ:g} Hz without delay."
)


def _style(loop: Mapping[str, Any]) -> str:
    return STYLES.get(loop_name(loop), "s6")


def _pole_map(loops: Loops, axis: str) -> str:
    marks = []
    for loop in loops:
        for real, imaginary in loop["axes"][axis]["poles"]:
            sign = "+" if imaginary >= 0.0 else "−"
            hint = f"{loop_title(loop)}: {number(real)} {sign} {number(abs(imaginary))} j /s"
            marks.append(Mark(real, imaginary, _style(loop), hint))
    real, imaginary = (np.array([mark[index] for mark in marks]) for index in (0, 1))
    drawn = chart(
        f"Poles of {axis}",
        spanning("real part [1/s]", [real, np.zeros(1)], least=_LEAST_SPAN),
        spanning("imaginary part [1/s]", [imaginary], least=_LEAST_SPAN),
        [],
        marks=marks,
        guides=[Guide("", 0.0, upright=True)],
        size=STEP_SIZE,
    )
    return f'<div><h3 class="plant">{escape(AXIS_TITLES[axis])}</h3>{drawn}</div>'


def _bode(loops: Loops, axis: str) -> str:
    dt_s = 1.0 / BODE_HZ
    frequency = np.geomspace(_LOWEST_RAD_S, 0.999 * np.pi * BODE_HZ, _POINTS)
    gain, phase = [], []
    for loop in loops:
        law = AttitudeGains(**loop["axes"][axis]["gains"])
        values = response(AttitudeTick(law, BODE_HZ, Actuators(1)).open(), frequency * dt_s)
        turned = np.degrees(np.unwrap(np.angle(values)))
        turned -= 360.0 * np.round((turned[0] + 180.0) / 360.0)  # begins between −360° and 0°
        gain.append(Line(loop_title(loop), frequency, 20.0 * np.log10(np.abs(values)), _style(loop)))
        phase.append(Line(loop_title(loop), frequency, turned, _style(loop)))
    along = Axis("frequency [rad/s]", _LOWEST_RAD_S, 1.25 * np.pi * BODE_HZ, log=True)
    heading = f'<h3 class="plant">{escape(AXIS_TITLES[axis])}</h3>'
    above = chart(
        f"Gain of the open loop, {axis}", along, spanning("gain [dB]", [line.y for line in gain]), gain,
        guides=[Guide("0 dB", 0.0)], size=STEP_SIZE,
    )  # fmt: skip
    below = chart(
        f"Phase of the open loop, {axis}", along, Axis("phase [°]", -400.0, -60.0), phase,
        guides=[Guide("−180°", -180.0)], size=STEP_SIZE,
    )  # fmt: skip
    return f"<div>{heading}{above}</div><div>{heading}{below}</div>"


def margins_table(loops: Loops) -> str:
    """Return natural frequency, damping, poles and margins of each axis and loop."""
    rows, rates = [], _rates(loops)
    for axis in ANGLES:
        for index, loop in enumerate(loops):
            of = loop["axes"][axis]
            head = f"<th>{escape(AXIS_TITLES[axis]) if not index else ''}</th><td>{escape(loop_title(loop))}</td>"
            mode = cell(fixed(of["natural_rad_s"], 1)) + cell(fixed(of["damping"], 2))
            figures = "".join(_margin_cell(_sampled(of)["margins"].get(rate)) for rate in rates)
            poles = f"<td>{escape(_poles(of['poles']))}</td>"
            rows.append(row(f"{head}{mode}{poles}{figures}{_lag_cell(of)}", not index))
    heads = (f"#{rate} Hz" for rate in rates)
    columns = ("axis", "controller", "#ωn [rad/s]", "#ζ", "poles [1/s]", *heads, "#motor lag borne")
    return wide_table(columns, rows)


def _lag_cell(of: Mapping[str, Any]) -> str:
    lag_s = of["largest_lag_s"]
    return cell("any" if lag_s is None else f"{fixed(1e3 * lag_s, 1)} ms")


def _rates(loops: Loops) -> list[str]:
    return list(_sampled(loops[0]["axes"]["roll"])["margins"])


def _sampled(of: Mapping[str, Any]) -> Mapping[str, Any]:
    named = {entry["actuators"]: entry for entry in of["sampled"]}
    found: Mapping[str, Any] = named.get(SHOWN_ACTUATORS, of["sampled"][0])
    return found


def _margin_cell(margins: Mapping[str, Any] | None) -> str:
    if margins is None:
        return '<td class="n bad">unstable</td>'
    gain, phase = fixed(margins["gain_db"], 1), fixed(margins["phase_deg"], 0)
    gain_text = "any gain" if gain == UNKNOWN else f"{gain} dB"
    phase_text = "any phase" if phase == UNKNOWN else f"{phase}°"
    return cell(f"{gain_text}, {phase_text}")


def _poles(poles: Sequence[Sequence[float]]) -> str:
    told = []
    for real, imaginary in poles:
        if imaginary < 0.0:
            continue  # told with its conjugate
        told.append(number(real) if imaginary == 0.0 else f"{number(real)} ± {number(imaginary)} j")
    return ", ".join(told)
