"""The report of ``gcs paper``: verdicts on the paper's claims, then section IV of the paper with figures and tables.

Numbers come from ``results``, the content of results.json; curves come from the recordings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from gcs_cli.charts.figure import AnyFigure
from gcs_cli.charts.pages import render_page
from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.flights.types import Case
from gcs_cli.experiments.paper.pil_section import EMULATED, folder_name
from gcs_cli.experiments.paper.report import figures, tables
from gcs_cli.experiments.paper.report.labels import LABELS, PLANTS, fixed
from gcs_cli.experiments.paper.report.linear_figures import linear_figures
from gcs_cli.experiments.paper.report.pictures import Picture
from gcs_cli.experiments.paper.report.verdicts import endings, pil_flights, verdicts

TEMPLATES = Path(__file__).parent / "templates"
PAPER = "Quadcopter Modelling, Control Design and PIL Verification Based on DSP F28377s"
_PARTS = {"linear": "linear analysis", "onset": "onset of instability", "pil": "processor in the loop",
          cases.MULTIBODY: "multibody plant"}  # fmt: skip


class Section(NamedTuple):
    """A card of the page; ``name`` is its anchor."""

    name: str
    title: str
    note: str = ""
    tables: Sequence[tables.Table] = ()
    figures: Sequence[AnyFigure] = ()
    links: Sequence[str] = ()

    @property
    def empty(self) -> bool:
        """True without rows and curves."""
        return not any(table.rows for table in self.tables) and not any(not one.empty for one in self.figures)


def report_figures(results: Mapping[str, Any], recordings: figures.Recordings) -> list[AnyFigure]:
    """Return all figures of the report in the order of the page."""
    found: list[AnyFigure] = [*figures.desired_figures(recordings), *figures.response_figures(recordings)]
    found += [*figures.step_figure(recordings), *figures.xy_figure(recordings)]
    found += [*figures.plants_figure(recordings), *linear_figures(results["linear"])]
    return [*found, *figures.profile_figure(results["pil"])]


def render(
    results: Mapping[str, Any],
    recordings: figures.Recordings,
    drawn: Sequence[AnyFigure],
    pictures: Sequence[Picture] = (),
) -> str:
    """Return the report as HTML with the figures ``drawn``; parts missing in ``results`` are named with the reason."""
    sections = [one for one in _sections(results, recordings, drawn) if not one.empty]
    crashed, lost = endings(results)
    return render_page(
        TEMPLATES,
        "report.html",
        paper=PAPER,
        version=results["version"],
        flights=len(results["cases"]),
        crashed=crashed,
        lost=lost,
        inner_hz=Case("", "").inner_hz,
        outer_hz=Case("", "").outer_hz,
        verdicts=verdicts(results),
        sections=sections,
        pictures=pictures,
        left_out={_PARTS.get(part, part): why for part, why in _left_out(results).items()},
    )


def _left_out(results: Mapping[str, Any]) -> dict[str, str]:
    left_out = dict(results["left_out"])
    if results["pil"] and results["pil"]["why_left_out"]:
        left_out["pil"] = results["pil"]["why_left_out"]
    return left_out


def _sections(
    results: Mapping[str, Any], recordings: figures.Recordings, drawn: Sequence[AnyFigure]
) -> Iterator[Section]:
    def of(*names: str) -> list[AnyFigure]:
        return [figure for figure in drawn if figure.name in names]

    yield Section(
        "tables", "Tables I to III", "–: not in the paper. Red: the flown value differs from the printed one.",
        tables.printed_tables(results["vehicle"], results["gains"]),
    )  # fmt: skip
    yield Section(
        "fig-7", "Fig. 7: desired trajectory", "The paper's figures have no numbers: this trajectory is a choice.",
        figures=of("fig-7-time", "fig-7-space"),
    )  # fmt: skip
    yield from _flown(results["cases"], recordings, of)
    yield from _analysed(results, of)
    pil = results["pil"]
    if pil and pil["controllers"]:
        yield Section(
            "fig-15", "Fig. 15: processor in the loop", _about_target(pil),
            [tables.profile_table(pil), tables.equivalence_table(pil)], of("fig-15"),
            [f"{folder_name(name, plant)}/pil.html" for name, plant, _ in pil_flights(pil)],
        )  # fmt: skip
    yield Section(
        "corrections", "Corrections of the paper", "Reasons: docs/explanation/paper.md.",
        [tables.corrections_table(results["corrections"])],
    )  # fmt: skip


def _flown(
    found: Mapping[str, Any], recordings: figures.Recordings, of: Callable[..., list[AnyFigure]]
) -> Iterator[Section]:
    """Yield the sections of the flights; ``of`` returns the figures of these names."""
    yield Section(
        "fig-8", "Figs. 8 to 13: responses",
        "Roll and pitch errors refer to the target of each controller's outer loop; the PID's is drawn.",
        [tables.response_table(found, figures.beside(recordings))], of(*(f"fig-{number}" for number in range(8, 14))),
    )  # fmt: skip
    yield Section(
        "steps", "Step responses", "Small-angle plant. Yaw steps saturate the rotors.",
        [tables.step_table(found)], of("steps"),
    )  # fmt: skip
    yield Section(
        "fig-14", "Fig. 14: PID and backstepping in XY",
        f"Overshoot: median over the moves of x and y that begin at rest in all flights of a row.{_ended(recordings)}",
        [tables.overshoot_table(found)], of("fig-14"),
    )  # fmt: skip
    yield Section(
        "disturbances", "Disturbances on the hard profile",
        "RMS distance from the reference [m]; green: the smallest on that plant, and all within 1 % of it.",
        [tables.disturbance_table(found)],
    )  # fmt: skip


def _analysed(results: Mapping[str, Any], of: Callable[..., list[AnyFigure]]) -> Iterator[Section]:
    """Yield the sections of the linear analysis and of the comparison of the plants."""
    loops: tables.Loops = results["linear"]["loops"] if results["linear"] else ()
    onset = results["onset"] or ()
    yield Section(
        "margins", "Stability and margins of the attitude loops",
        "As flown: motor lag 5 ms, no delay; cut at the angular acceleration demand. Only the rigid body and the "
        "multibody plant have the rotors' spin-up torque.",
        [tables.margins_table(loops)], of("bode", "poles"),
    )  # fmt: skip
    yield Section(
        "margins-outer", "Stability and margins of x, y and z",
        "Cut at the acceleration demand, inner loop at 1 kHz, outer loop at 250 Hz. Step without rate feedforward.",
        [tables.outer_table(loops)],
    )  # fmt: skip
    yield Section(
        "onset", "Lowest stable inner rates", _onset_note(onset), [tables.onset_table(onset)],
    )  # fmt: skip
    yield Section(
        "plants", "Plants compared",
        "Largest difference along the desired trajectory. Undecided: the loop is unstable and amplifies rounding, "
        "as a push of 10⁻¹² N shows.",
        [tables.plants_table(results["plants"])], of("plants"),
    )  # fmt: skip


def _onset_note(onset: Sequence[Mapping[str, Any]]) -> str:
    apart = [abs(one["difference_percent"]) for one in onset if one["difference_percent"] is not None]
    if not apart:
        return ""
    return (
        "Predicted by eigenvalues, simulated with the real loops and plant: "
        f"at most {fixed(max(apart), 2)} % apart in {len(apart)} inner and outer loops."
    )


def _ended(recordings: figures.Recordings) -> str:
    early = figures.ended(recordings)
    return f" Ended early: {'; '.join(early)}." if early else ""


def _about_target(pil: Mapping[str, Any]) -> str:
    target = next((of["target"] for of in pil["controllers"].values() if of["target"]), None)
    if target is None:
        return ""
    stacks = [of["stack"]["high_water"] for of in pil["controllers"].values() if of["stack"]]
    stack = f" Stack: at most {max(stacks)} bytes." if stacks and target["char_bits"] == 8 else ""
    clock = (
        "instructions are counted, not the cycles of an F28377S" if pil["target"] == EMULATED
        else f"{fixed(target['clock_hz'] / 1e6, 0)} MHz"
    )  # fmt: skip
    where = f"{LABELS[cases.BACKSTEPPING]} also on the {PLANTS[cases.RIGID]}"
    return f"{target['board']}: {clock}.{stack} A mission along the waypoints of Fig. 7; {where}."
