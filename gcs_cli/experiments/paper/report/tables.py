"""Tables of the report as rows of text. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple, TypeAlias

from gcs_cli.experiments.paper.findings.comparisons import shared_overshoots
from gcs_cli.experiments.paper.flights import cases
from gcs_cli.experiments.paper.linear.onset import IDEAL, LAGGING
from gcs_cli.experiments.paper.linear.onset import SPIN_UP as SPIN_UP_ONSET
from gcs_cli.experiments.paper.report.labels import (
    ANGLES,
    AXES,
    AXIS_NAMES,
    LABELS,
    PLANTS,
    UNKNOWN,
    fixed,
    loop_name,
    loop_title,
    number,
    plain,
)
from gcs_cli.experiments.paper.report.verdicts import FLOWN, SPIN_UP, pil_flights, sampled, small, space_rms_m
from gcs_cli.pil.profile import STAGE_TITLES

Cases: TypeAlias = Mapping[str, Mapping[str, Any]]
"""``cases`` of results.json."""
Loops: TypeAlias = Sequence[Mapping[str, Any]]
PAIR = (cases.PID, cases.BACKSTEPPING)
COMPARED = (cases.PID, cases.RATE_FED_PID, cases.BACKSTEPPING, cases.POLES)
BOTH = (cases.SMALL_ANGLE, cases.RIGID)
HOW_ENDED = {"crashed": "crashed", "lost": "lost"}
SPIN_UP_TITLE = "yaw, spin-up torque"
_CONDITIONS = {
    cases.PLAIN: "as flown", cases.NO_LIMITS: "no rotor limits", cases.IDEAL: "ideal rotors", "force": "wind 0.5 N",
    "torque": "torque 20 mN m", "mass_more": "mass +20 %", "inertia_more": "inertia +30 %",
    "inertia_less": "inertia −30 %", "lag_10": "motor lag 10 ms", "lag_20": "motor lag 20 ms", "delay": "delay 1 ms",
    "slow": "inner loop 500 Hz", "twice": "path doubled", cases.DRIVE: "motor torque 0.2 N m",
}  # fmt: skip
_OVER = (cases.PLAIN, cases.NO_LIMITS, cases.IDEAL)
_OVER_TITLES = dict(zip(_OVER, ("as flown", "no limits", "ideal rotors"), strict=True))
_TITLES = {"table_1": "Table I: vehicle", "table_2": "Table II: PID", "table_3": "Table III: backstepping"}


class Cell(NamedTuple):
    """A cell and its class in the style sheet."""

    text: str
    style: str = ""


Row: TypeAlias = Sequence[Cell | str]


class Table(NamedTuple):
    """A table; the first ``heads`` columns are row headings, the others numbers. Empty without rows."""

    columns: Sequence[str]
    rows: Sequence[Row]
    caption: str = ""
    heads: int = 1
    text: bool = False
    """All cells are text."""
    groups: Sequence[tuple[str, int]] = ()
    """Headings above the columns, each with its number of columns; empty: none."""


def printed_tables(vehicle: Mapping[str, Any], gains: Mapping[str, Any]) -> list[Table]:
    """Return Tables I to III: the printed values beside the flown ones."""
    return [
        Table(
            ("", "printed", "flown", "unit"),
            [
                (
                    symbol,
                    plain(of["printed"]),
                    Cell(plain(of["used"]), "bad" if of["corrected"] else ""),
                    of["unit"].replace(" ", "·"),
                )
                for symbol, of in entries.items()
            ],
            _TITLES.get(name, name),
        )
        for name, entries in {"table_1": vehicle, **gains}.items()
    ]


def corrections_table(corrections: Sequence[Mapping[str, Any]]) -> Table:
    """Return the printed forms that are wrong, with the forms that fly."""
    rows = [(one["where"], one["printed"], one["used"]) for one in corrections]
    return Table(("where", "printed", "flown"), rows, text=True)


def _unit(axis: str) -> tuple[str, float, int]:
    return ("°", math.degrees(1.0), 2) if axis in ANGLES else ("mm", 1e3, 1)


def _endings(case: Mapping[str, Any], columns: int) -> list[Cell]:
    """Return cells for a flight that ended early."""
    return [Cell(HOW_ENDED[case["ended"]["how"]], "bad"), *[Cell("")] * (columns - 1)]


def response_table(found: Cases, plants: Sequence[str]) -> Table:
    """Return RMS and largest errors of both controllers along the desired trajectory on these plants."""
    rows: list[Row] = []
    for axis in AXES:
        for index, name in enumerate(PAIR):
            unit, factor, places = _unit(axis)
            cells: list[Cell | str] = [f"{AXIS_NAMES[axis]} [{unit}]" if not index else "", LABELS[name]]
            for plant in plants:
                case = found.get(cases.key(name, cases.DESIRED, cases.PLAIN, plant))
                if case is None:
                    cells += [UNKNOWN, UNKNOWN]
                elif case["ended"] is not None:
                    cells += _endings(case, 2)
                else:
                    of = case["metrics"][axis]
                    cells += [fixed(factor * of[key], places) for key in ("rms_error", "max_error")]
            rows.append(cells)
    columns = ("axis", "controller", *("RMS error", "largest") * len(plants))
    groups = [("", 2), *((PLANTS[plant], 2) for plant in plants)]
    return Table(columns, rows if plants else (), heads=2, groups=groups)


def step_table(found: Cases) -> Table:
    """Return overshoot and settling time of each axis that steps, on the small-angle plant."""
    rows: list[Row] = []
    for axis in AXES:
        flown = [found.get(cases.key(name, f"step_{axis}")) for name in PAIR]
        if any(flown):
            rows.append([AXIS_NAMES[axis], *(cell for case in flown for cell in _step_cells(case, axis))])
    columns = ("axis", *("overshoot [%]", "settling [s]") * len(PAIR))
    return Table(columns, rows, groups=[("", 1), *((LABELS[name], 2) for name in PAIR)])


def _step_cells(case: Mapping[str, Any] | None, axis: str) -> list[Cell | str]:
    if case is None:
        return [UNKNOWN, UNKNOWN]
    if case["ended"] is not None:
        return [*_endings(case, 2)]
    of = case["metrics"][axis]
    return [fixed(of["overshoot_percent"]), fixed(of["settling_time_s"], 2)]


def overshoot_table(found: Cases) -> Table:
    """Return the XY error on the smooth profile and the median overshoot on the hard one, with and without limits."""
    rows: list[Row] = []
    for plant in BOTH:
        for index, condition in enumerate(_OVER):
            smooth, hard = (
                {name: found.get(cases.key(name, profile, condition, plant)) for name in COMPARED}
                for profile in (cases.SMOOTH, cases.HARD)
            )
            if any(smooth.values()) or any(hard.values()):
                cells = [*_path_cells(smooth), *_overshoot_cells(hard)]
                rows.append([PLANTS[plant] if not index else "", _OVER_TITLES[condition], *cells])
    columns = ("plant", "rotors", *[LABELS[name] for name in COMPARED] * 2)
    groups = [("", 2), ("smooth: XY RMS error [mm]", len(COMPARED)), ("hard: overshoot [%]", len(COMPARED))]
    return Table(columns, rows, heads=2, groups=groups)


def _path_cells(flown: Mapping[str, Mapping[str, Any] | None]) -> Iterator[Cell | str]:
    for case in flown.values():
        if case is None:
            yield UNKNOWN
        elif case["ended"] is not None:
            yield from _endings(case, 1)
        else:
            yield fixed(1e3 * case["path"]["rms_error_m"])


def _overshoot_cells(flown: Mapping[str, Mapping[str, Any] | None]) -> Iterator[Cell | str]:
    """Yield medians over the moves of x and y that began at rest in all flights that reached their end."""
    whole = {name: case for name, case in flown.items() if case is not None and case["ended"] is None}
    over = shared_overshoots(list(whole.values()))
    medians = dict(zip(whole, over.median_percent if over else (), strict=False))
    for name, case in flown.items():
        if case is not None and case["ended"] is not None:
            yield from _endings(case, 1)
        else:
            yield fixed(medians.get(name))


def disturbance_table(found: Cases) -> Table:
    """Return the RMS distance from the hard profile for each condition, controller and plant; the best is marked."""
    names = (*PAIR, cases.TUNED_PID)
    rows: list[Row] = []
    for condition, label in _CONDITIONS.items():
        flown = [
            [found.get(cases.key(name, cases.HARD, condition, plant)) for name in names] for plant in BOTH
        ]
        if any(any(of) for of in flown):
            rows.append([label, *(cell for of in flown for cell in _distance_cells(of))])
    columns = ("condition", *[LABELS[name] for name in names] * len(BOTH))
    return Table(columns, rows, groups=[("", 1), *((PLANTS[plant], len(names)) for plant in BOTH)])


def _distance_cells(flown: Sequence[Mapping[str, Any] | None]) -> Iterator[Cell | str]:
    distances = [space_rms_m(case) for case in flown if case is not None and case["ended"] is None]
    best = min(distances, default=math.inf)
    for case in flown:
        if case is None:
            yield UNKNOWN
        elif case["ended"] is not None:
            yield from _endings(case, 1)
        else:
            distance_m = space_rms_m(case)
            yield Cell(fixed(distance_m, 3), "best" if distance_m <= 1.01 * best else "")


def plants_table(plants: Mapping[str, Any]) -> Table:
    """Return the largest differences of the plants along the desired trajectory."""
    bounded, other = (
        plants.get(f"{one}_{two}", {})
        for one, two in ((cases.RIGID, cases.MULTIBODY), (cases.SMALL_ANGLE, cases.RIGID))
    )
    rows: list[Row] = [
        [
            LABELS.get(name, name),
            *_apart(bounded.get(name)),
            _bound(bounded.get(name)),
            *_apart(other.get(name)),
        ]
        for name in dict.fromkeys((*bounded, *other))
    ]
    columns = ("controller", "[mm]", "[°]", "within 1 cm, 0.5°", "[mm]", "[°]")
    groups = [("", 1), ("rigid body – multibody", 3), ("small-angle – rigid body", 2)]
    return Table(columns, rows, groups=groups)


def _apart(of: Mapping[str, Any] | None) -> list[Cell | str]:
    if of is None:
        return [UNKNOWN, UNKNOWN]
    return [small(1e3 * of["max_position_m"]), small(of["max_attitude_deg"])]


def _bound(of: Mapping[str, Any] | None) -> Cell:
    if of is None:
        return Cell(UNKNOWN)
    if of["rounding"] is not None and not of["bound_decides"]:
        return Cell("undecided")
    return Cell("yes", "good") if of["within_bounds"] else Cell("no", "bad")


def own_feedback(loops: Loops, axis: str) -> list[Mapping[str, Any]]:
    """Return the loops with distinct feedback on an axis; feedforward moves no pole."""
    found: dict[tuple[float, ...], Mapping[str, Any]] = {}
    for loop in loops:
        law = loop["axes"][axis]["gains"]
        found.setdefault((law["kp"], law["ki"], law["kd"]), loop)
    return list(found.values())


def shown_loops(loops: Loops) -> list[Mapping[str, Any]]:
    """Return the loops without those of our backstepping gains, which place the poles of our PID."""
    return [loop for loop in loops if loop_name(loop) != cases.TUNED_BACKSTEPPING]


def margins_table(loops: Loops) -> Table:
    """Return damping, margins at 1 kHz, and the lowest stable rate of each attitude loop as flown."""
    rows: list[Row] = []
    lines = [*((axis, FLOWN, AXIS_NAMES[axis]) for axis in ANGLES), ("yaw", SPIN_UP, SPIN_UP_TITLE)]
    for axis, actuators, title in lines:
        for index, loop in enumerate(shown_loops(own_feedback(loops, axis))):
            whole = loop["axes"][axis]
            if (of := sampled(whole, actuators)) is None:
                continue
            cells: list[Cell | str] = [title if not index else "", loop_title(loop)]
            mode = (fixed(whole["natural_rad_s"]), fixed(whole["damping"], 2))
            cells += mode if actuators == FLOWN else ("", "")
            cells += _margin_cells(of["margins"].get("1000"))
            rows.append([*cells, fixed(of["lowest_stable_hz"])])
    heads = ("ωn [rad/s]", "ζ", "gain margin [dB]", "phase margin [°]", "lowest rate [Hz]")
    return Table(("axis", "controller", *heads), rows, heads=2)


def _margin_cells(of: Mapping[str, Any] | None) -> list[Cell | str]:
    if of is None:
        return [Cell("unstable", "bad"), ""]
    return [fixed(of["gain_db"]), fixed(of["phase_deg"], 0)]


def outer_table(loops: Loops) -> Table:
    """Return step response, margins and lowest outer rate of x, y and z; equal loops share a row."""
    rows: list[Row] = []
    for axis in ("x", "y", "z"):
        shared: dict[tuple[Cell | str, ...], list[str]] = {}
        for loop in shown_loops(loops):
            whole = loop["axes"][axis]
            if (of := sampled(whole, FLOWN)) is not None:
                shared.setdefault(tuple(_outer_cells(whole, of)), []).append(loop_title(loop))
        for index, (cells, titles) in enumerate(shared.items()):
            title = titles[0] if len(titles) == 1 else f"{titles[0]} and {len(titles) - 1} more"
            rows.append([AXIS_NAMES[axis] if not index else "", title, *cells])
    heads = ("overshoot [%]", "settling [s]", "gain margin [dB]", "phase margin [°]",
             "lowest rate [Hz]")  # fmt: skip
    return Table(("axis", "controller", *heads), rows, heads=2)


def _outer_cells(whole: Mapping[str, Any], of: Mapping[str, Any]) -> Iterator[Cell | str]:
    step = whole["step"] or {}
    yield from (fixed(step.get("overshoot_percent")), fixed(step.get("settling_s"), 2))
    yield from _margin_cells(of["margins"].get("1000/250"))
    yield fixed(of["lowest_stable_outer_hz"], 2)


_SETTINGS = {
    IDEAL.name: "ideal rotors, one step of delay", LAGGING.name: "motor lag, one step of delay",
    SPIN_UP_ONSET.name: "motor lag, spin-up torque",
}  # fmt: skip


def onset_table(onset: Sequence[Mapping[str, Any]]) -> Table:
    """Return the lowest stable inner rates of the paper's gains, predicted and simulated."""
    found: dict[tuple[str, str], dict[str, Mapping[str, Any]]] = {}
    for one in onset:
        if one["gains"] == "paper" and one["axis"] in ANGLES:
            found.setdefault((one["setting"], one["axis"]), {})[one["controller"]] = one
    rows: list[Row] = []
    before = ""
    for (setting, axis), of in found.items():
        cells = [
            fixed(of[name][key], 2) if name in of else UNKNOWN
            for name in PAIR
            for key in ("predicted_hz", "simulated_hz")
        ]
        rows.append([_SETTINGS.get(setting, setting) if setting != before else "", AXIS_NAMES[axis], *cells])
        before = setting
    columns = ("setting", "axis", *("predicted [Hz]", "simulated [Hz]") * len(PAIR))
    return Table(columns, rows, heads=2, groups=[("", 2), *((LABELS[name], 2) for name in PAIR)])


_PROFILE = (("mean", 1), ("max", 0))


def profile_table(pil: Mapping[str, Any]) -> Table:
    """Return the execution profile of each stage on the target, in the unit of the profile."""
    profiles = {name: of["profile"] for name, of in pil["controllers"].items() if of["profile"]}
    unit = next((profile["unit"] for profile in profiles.values()), "")
    rows: list[Row] = []
    for stage, title in STAGE_TITLES.items():
        of = {name: profile["stages"].get(stage) for name, profile in profiles.items()}
        if any(of.values()):
            figures = [
                fixed(one[key], places) if one else UNKNOWN for one in of.values() for key, places in _PROFILE
            ]
            rows.append([title, *figures])
    columns = ("stage", *("mean", "largest") * len(profiles))
    groups = [("", 1), *((LABELS.get(name, name), len(_PROFILE)) for name in profiles)]
    return Table(columns, rows, f"Fig. 15: {unit} per step", groups=groups)


def equivalence_table(pil: Mapping[str, Any]) -> Table:
    """Return the largest differences of each mission: Python loops and target, then host and target."""
    rows: list[Row] = []
    for name, plant, of in pil_flights(pil):
        verdict = Cell(of["verdict"], "good" if of["verdict"] == "passed" else "bad")
        python = _of_pair(of, "MIL–PIL")
        position = next((row["largest"] for row in python if row["signal"] == "position"), None)
        shown = UNKNOWN if position is None else number(1e6 * position)
        figures = (shown, _ulps(python), _ulps(_of_pair(of, "SIL–PIL")))
        rows.append([f"{LABELS.get(name, name)}, {PLANTS[plant]}", *figures, verdict])
    columns = ("mission", "position [µm]", "any signal [ulp]", "any signal [ulp]", "verdict")
    groups = [("", 1), ("Python and target", 2), ("host and target", 1), ("", 1)]
    return Table(columns, rows, "Numerical equivalence", groups=groups)


def _of_pair(of: Mapping[str, Any], pair: str) -> list[Mapping[str, Any]]:
    return [row for row in of["differences"] if row["pair"] == pair]


def _ulps(rows: Sequence[Mapping[str, Any]]) -> str:
    return fixed(max((row["ulps"] for row in rows if row["ulps"] is not None), default=None), 0)
