"""The linear analysis as parts of the report: poles, Bode plots and margins. Pure."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from gcs_cli.experiments.paper.linear.gains import AttitudeGains
from gcs_cli.experiments.paper.linear.margins import response
from gcs_cli.experiments.paper.linear.sampled import Actuators, AttitudeTick
from gcs_cli.experiments.paper.report_axes import Axis, Guide, chart, spanning
from gcs_cli.experiments.paper.report_flights import STEP_SIZE
from gcs_cli.experiments.paper.report_labels import ANGLES, AXIS_TITLES, anchored
from gcs_cli.experiments.paper.report_margins import SPIN_UP_TITLE, Loops, margin_sections, own_feedback
from gcs_cli.experiments.paper.report_onset import loop_title, onset_section
from gcs_cli.experiments.paper.report_poles import loop_style, pole_maps
from gcs_cli.report.chart import Line
from gcs_cli.report.plots import section

BODE_HZ = 1000.0
_POINTS = 360
_CRITICAL_DEG = np.array([-180.0])
_LOWEST_RAD_S = 1.0


def linear_sections(linear: Mapping[str, Any], onset: Sequence[Mapping[str, Any]], why: str) -> Iterator[str]:
    """Yield the sections; one with the sentence ``why`` if the analysis was left out."""
    if not linear:
        yield anchored("linear", section("Linear analysis", f'<p class="none">Left out: {escape(why)}</p>'))
        return
    loops: Loops = linear["loops"]
    legend = [(loop_title(loop), loop_style(loop), False) for loop in loops]
    note = (
        "Continuous loops at hover. Attitude: feedback alone, without feed-forward and integral of the outer loop. x "
        "and y: with reference filter and attitude loop inside. The linear PD has backstepping's poles by "
        "construction; the paper's controllers share one height loop; a rate that is fed ahead moves no pole of an "
        "attitude, but those of x and y. Pointing at a pole shows its numbers."
    )
    body = f'<div class="pair">{pole_maps(loops)}</div>'
    yield anchored("linear", section("Linear analysis: poles", body, legend, note))
    flown = Actuators(0, linear["motor_lag_s"])
    spinning = flown._replace(lead_s=linear["spin_up_lead_s"])
    bode = "".join(_bode(loops, axis, flown, AXIS_TITLES[axis]) for axis in ANGLES)
    bode += _bode(loops, "yaw", spinning, SPIN_UP_TITLE)
    note = (
        f"Open attitude loops as they fly: cut at the law's demand, sampled at {BODE_HZ:g} Hz, held, motors of "
        f"{1e3 * flown.lag_s:g} ms. Gain margin: where the phase crosses −180°. Phase margin: where the gain crosses "
        "0 dB. The last pair has the torque by which rotors react to being spun up, as the rigid body and the "
        "multibody assembly have it: where its phase crosses −180° above 0 dB, yaw is unstable. A rate "
        "that is fed ahead is no part of a loop, so that the PID with it has the curves of the one without."
    )
    title = "Linear analysis: open loops"
    legend = [(loop_title(loop), loop_style(loop), False) for loop in own_feedback(loops, "roll")]
    yield anchored("bode", section(title, f'<div class="pair">{bode}</div>', legend, note))
    yield from margin_sections(linear)
    yield onset_section(onset)


def _bode(loops: Loops, axis: str, actuators: Actuators, title: str) -> str:
    dt_s = 1.0 / BODE_HZ
    frequency = np.geomspace(_LOWEST_RAD_S, 0.999 * np.pi * BODE_HZ, _POINTS)
    gain, phase = [], []
    for loop in own_feedback(loops, axis):
        law = AttitudeGains(**loop["axes"][axis]["gains"])
        values = response(AttitudeTick(law, BODE_HZ, actuators).open(), frequency * dt_s)
        turned = np.degrees(np.unwrap(np.angle(values)))
        turned -= 360.0 * np.round((turned[0] + 180.0) / 360.0)  # begins between −360° and 0°
        gain.append(Line(loop_title(loop), frequency, 20.0 * np.log10(np.abs(values)), loop_style(loop)))
        phase.append(Line(loop_title(loop), frequency, turned, loop_style(loop)))
    along = Axis("frequency [rad/s]", _LOWEST_RAD_S, 1.25 * np.pi * BODE_HZ, log=True)
    heading = f'<h3 class="plant">{escape(title)}</h3>'
    above = chart(
        f"Gain of the open loop, {title}", along, spanning("gain [dB]", [line.y for line in gain]), gain,
        guides=[Guide("0 dB", 0.0)], size=STEP_SIZE,
    )  # fmt: skip
    turns = spanning("phase [°]", [_CRITICAL_DEG, *(line.y for line in phase)])
    below = chart(
        f"Phase of the open loop, {title}", along, turns, phase,
        guides=[Guide("−180°", -180.0)], size=STEP_SIZE,
    )  # fmt: skip
    return f"<div>{heading}{above}</div><div>{heading}{below}</div>"
