"""What came out, in sentences; every number in them comes from the results. Pure."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

from gcs_cli.experiments.paper import cases
from gcs_cli.experiments.paper.pil_section import EMULATED
from gcs_cli.experiments.paper.report_findings import (
    Results,
    ended,
    flies,
    onset_apart,
    paper_claims,
    pil_flights,
    same_bits,
    worst_plants,
)
from gcs_cli.experiments.paper.report_labels import LABELS, PLANTS, fixed, minus, number
from gcs_cli.experiments.paper.report_margins import FLOWN, sampled
from gcs_cli.experiments.paper.report_matrix import space_rms
from gcs_cli.experiments.paper.types import Case

_SPIN_UP = "spin-up"
"""In the name of the onset's setting that has the rotors' spin-up torque."""
_PARTS = {"linear": "linear analysis", "onset": "onset of instability", "pil": "processor in the loop"}


def sentences(results: Results) -> Iterator[str]:
    """Yield the sentences, as HTML."""
    corrected = len(results["corrections"])
    yield (
        f"The paper's model and both controllers fly, with {corrected} corrections of what is printed; "
        '<a href="#corrections">each is named</a>. None of its figures has numbers, so shapes and claims can be '
        "compared, and no curve."
    )
    yield from _of_claims(results)
    yield from _of_gains(results)
    yield from _of_endings(results)
    yield from _of_plants(results)
    yield from _of_linear(results)
    yield from _of_pil(results)
    left_out = dict(results["left_out"])
    if results["pil"] and results["pil"]["why_left_out"]:
        left_out["pil"] = results["pil"]["why_left_out"]
    for part, why in left_out.items():
        yield f'<span class="bad">Left out: {escape(_PARTS.get(part, part))}</span>: {escape(why)}'


def _of_claims(results: Results) -> Iterator[str]:
    for of in paper_claims(results).values():
        held = [PLANTS.get(claim["plant"], claim["plant"]) for claim in of if claim["holds"]]
        fell = [PLANTS.get(claim["plant"], claim["plant"]) for claim in of if not claim["holds"]]
        verdict = '<b class="good">Holds</b>' if not fell else '<b class="bad">Does not hold</b>'
        told = of[:1]
        if held and fell:
            verdict = f"<b>Holds on the {escape(', '.join(held))}, not on the {escape(', '.join(fell))}</b>"
            told = of
        words = escape(minus(" ".join(claim["words"] for claim in told)))
        yield f"“{escape(of[0]['claim'])}” ({escape(of[0]['source'])}): {verdict}. {words}"


def _of_gains(results: Results) -> Iterator[str]:
    """Say what own gains reach beside the paper's, on the hard profile's overshoot and the smooth profile's error."""
    found = results["cases"]
    names = (cases.PID, cases.RATE_FED_PID, cases.BACKSTEPPING, cases.POLES, cases.TUNED_PID)
    flown = {name: found.get(cases.key(name, cases.SMOOTH)) for name in names}
    told = [
        f"{fixed(1e3 * space_rms(case), 1)} mm ({LABELS[name]})"
        for name, case in flown.items()
        if flies(case)
    ]
    if len(told) == len(names):
        yield escape(
            f"What the gains do, beside what the method does: RMS error on the smooth profile, small-angle model: "
            f"{', '.join(told)}."
        )


def _of_endings(results: Results) -> Iterator[str]:
    """Say who did not come to the end, and with what."""
    if not results["cases"]:
        return
    found = {how: _by_contender(results, ended(results, how)) for how in ("crashed", "lost")}
    for how, words in (
        ("crashed", "Flights that ended in a crash"),
        ("lost", "Flights that lost control and flew on"),
    ):
        told = [f"{LABELS.get(name, name)} ({'; '.join(of)})" for name, of in found[how].items()]
        yield escape(f"{words}, and with what: {', '.join(told)}." if told else f"{words}: none.")
    flown = {key.split("/")[0] for key in results["cases"]}
    never = [
        title
        for name, title in LABELS.items()
        if name in flown and not any(name in of for of in found.values())
    ]
    if never and len(never) < len(flown):
        yield escape(f"All flights came to their end with: {', '.join(never)}.")


def _by_contender(results: Results, keys: list[str]) -> dict[str, list[str]]:
    """Sort keys of cases by contender, each with the labels of its conditions."""
    labels = results["conditions"]
    found: dict[str, list[str]] = {}
    for key in keys:
        name, _, condition, _ = key.split("/") if key.count("/") == 3 else (key, "", key, "")
        told = found.setdefault(name, [])
        if (label := labels.get(condition, condition)) not in told:
            told.append(label)
    return found


def _of_plants(results: Results) -> Iterator[str]:
    worst, of = worst_plants(results), results["plants"].get(f"{cases.RIGID}_{cases.MULTIBODY}")
    if not of:
        return
    one = next(iter(of.values()))
    bound = f"{fixed(100.0 * one['position_bound_m'], 0)} cm and {fixed(one['attitude_bound_deg'], 1)}°"
    if worst is not None:
        broken = [
            LABELS.get(name, name)
            for name, found in of.items()
            if found["bound_decides"] and not found["within_bounds"]
        ]
        verdict = f"not within {bound}: {', '.join(broken)}" if broken else f"the bound of {bound} is kept"
        yield escape(
            "Rigid body (our equations) and multibody assembly (MuJoCo's mechanics) stay within "
            f"{number(1e3 * worst[0], 2)} mm and {number(worst[1], 2)}° of each other over the whole desired "
            f"trajectory, with all loops that do not magnify rounding; {verdict}."
        )
    for name, found in of.items():
        if not found["bound_decides"] and found["rounding"] is not None:
            yield escape(
                f"With {LABELS.get(name, name)}, two plants cannot be compared: a push of 10⁻¹² N moves its flight on "
                f"the rigid body by up to {number(1e3 * found['rounding']['max_position_m'])} mm from itself, because "
                f"its yaw loop is unstable there; the plants are {number(1e3 * found['max_position_m'])} mm apart."
            )


def _of_linear(results: Results) -> Iterator[str]:
    apart = onset_apart(results)
    if apart is None:
        return
    onset = [one for one in results["onset"] if one["gains"] == "paper" and one["predicted_hz"]]
    words = (
        f"The rate at which instability sets in is predicted within {fixed(apart, 2)} % of the simulated one"
    )
    yield escape(f"{words}, for inner and outer loops.")
    rates = {
        loop["controller"]: of["lowest_stable_hz"]
        for loop in (results["linear"]["loops"] if results["linear"] else ())
        if loop["gains"] == "paper" and (of := sampled(loop["axes"]["roll"], FLOWN)) is not None
    }
    if len(rates) == 2 and None not in rates.values():
        pid, backstepping = rates[cases.PID], rates[cases.BACKSTEPPING]
        nearer = "backstepping" if backstepping > pid else "the PID"
        yield escape(
            f"As it flies, the roll loop would be stable down to {fixed(pid, 0)} Hz with the paper's PID and to "
            f"{fixed(backstepping, 0)} Hz with its backstepping: by this measure {nearer} is nearer to instability."
        )
    for one in onset:
        if one["controller"] == cases.PID and _SPIN_UP in one["setting"]:
            yield escape(
                f"With {one['setting']}, the yaw loop of Table II would be stable from {fixed(one['predicted_hz'], 0)} "
                f"Hz on; the flights run it at {Case('', '').inner_hz} Hz."
            )


def _of_pil(results: Results) -> Iterator[str]:
    same, pil = same_bits(results), results["pil"]
    if same is None:
        return
    target = "an emulated Cortex-M4F (no board was measured)" if pil["target"] == EMULATED else pil["target"]
    apart = [
        row["largest"]
        for _, _, of in pil_flights(pil)
        for row in of["differences"]
        if row["signal"] == "position" and row["pair"] == "MIL–PIL" and row["largest"] is not None
    ]
    words = "the same bits" if same else "other bits, see below"
    position = (
        f" The path differs from that of the Python loops by {number(1e6 * max(apart))} µm at most."
        if apart
        else ""
    )
    yield escape(
        f"The C loops on {target} give {words} as on this machine, in every signal of all flights.{position}"
    )
