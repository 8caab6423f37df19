"""The figures as tables, and as plain values for a JSON file."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

from benchmarks import campaigns, emulated, step_costs, three_processes
from benchmarks.campaigns import Flown
from benchmarks.ground_load import Seen
from benchmarks.measure import Figure, short
from benchmarks.plants import PlantCost
from benchmarks.real_time import PERCENTILES
from benchmarks.round_trip import WAYS
from benchmarks.startup import Startup
from benchmarks.step_costs import Part
from benchmarks.table import Row, table
from benchmarks.three_processes import Case, Flights
from benchmarks.transfers import ITEMS, Transfers
from benchmarks.watching import SIZES, Watched
from flightstack.simulator_link.hot_frames import ActuatorsFrame, PlantStateFrame

# on a machine of the same kind: PX4 with an external simulator, ArduCopter's SITL in one process
THREE_PROCESSES = (("≥ 20", "PX4 10"), ("≥ 40", "PX4 18–23"), ("goal 100", "PX4 10"))
PLANT_FLOORS = {"rigid": "≥ 20", "multibody": "≥ 15"}
ONE_PROCESS = ("≥ 60, goal 200", "ArduCopter 70–76")
ON_SENSORS = ("goal 150", "ArduCopter 70–76")
CAMPAIGNS = (("goal 1000", "RotorPy 0.8, PyBullet 5, JAX 29"), ("goal 400", ""))
"""Others: simulators without autopilot, one vehicle, on the true state."""
FLIGHTS_A_MINUTE = "goal 1000"
PEER_HEADS = {
    "autopilots": (
        "FLIGHTS IN TURNS WITH OTHER AUTOPILOTS",
        ("square.plan, or 60 s of hover", "× real time"),
    ),
    "simulators": (
        "CAMPAIGN FLIGHTS IN TURNS WITH SIMULATORS WITHOUT AUTOPILOT",
        ("minute.plan, or rounds of a square, 500 Hz", "× real time, a core"),
    ),
}


def texts(results: dict[str, Any], machine: dict[str, Any]) -> Iterator[str]:
    """Yield the sections that were measured."""
    yield (
        f"{machine['system']}, {machine['cores']} cores, Python {machine['python']}; "
        f"other programs used {100 * machine['used_by_others']:.0f} % of the machine meanwhile.\n"
        "Median (least–greatest) of interleaved rounds. Steps are those of the inner loop.\n"
    )
    for key, section in _SECTIONS:
        if key in results:
            yield section(results) + "\n"


def _flights(results: dict[str, Any]) -> str:
    rows: list[Row] = []
    flown: dict[Case, Flights] = results["three_processes"]
    for (case, flight), marks in zip(flown.items(), THREE_PROCESSES, strict=True):
        rows.append(
            (f"three processes, TCP, log, {case}", flight.factor.text(), flight.step_us.text(), *marks)
        )
    for name, (factor, step_us) in results["one_process"].items():
        marks = ON_SENSORS if name.startswith("sensors") else ONE_PROCESS
        rows.append((f"one process, {name}, 500 Hz", factor.text(), step_us.text(), *marks))
    head = ("missions/square.plan", "× real time", "µs a step", "mark", "others")
    return table("FLIGHTS", head, rows)


def _campaigns(results: dict[str, Flown]) -> str:
    rows = [
        (
            f"campaign, {name}",
            flown.factor.text(),
            mark,
            flown.flights_a_minute.text(),
            FLIGHTS_A_MINUTE,
            others,
        )
        for (name, flown), (mark, others) in zip(results.items(), CAMPAIGNS, strict=True)
    ]
    head = (
        *("benchmarks/minute.plan, x_quad, gusts, 500 Hz", "× real time, a core", "mark"),
        *(f"60 s flights a minute, {campaigns.WORKERS} workers", "mark", "others"),
    )
    return table("CAMPAIGNS, kernels warm; a core: processor time of a flight", head, rows)


def _peers(results: dict[str, dict[str, Figure]]) -> str:
    return "\n\n".join(
        table(*PEER_HEADS[group], [(name, factor.text()) for name, factor in flown.items()])
        for group, flown in results.items()
    )


def _emulated(results: dict[str, emulated.Flown]) -> str:
    plain_s = results["python"].minute_s.median
    rows: list[Row] = [
        (
            f"--loops {loops}",
            short(flown.simulated_s),
            flown.wall_s.text(),
            flown.minute_s.text(),
            short(flown.minute_s.median / plain_s, 2),
            flown.processor_s.text(),
            "< 30" if loops == "emulated" else "",
        )
        for loops, flown in results.items()
    ]
    head = (
        *("benchmarks/minute.plan, 500 Hz", "simulated, s", "wall, s"),
        *("60 s of it, s", "× python", "processor, s", "mark"),
    )
    return table("FLIGHTS WITH OTHER LOOPS, three processes, log", head, rows)


def _plants(results: dict[str, PlantCost]) -> str:
    rows: list[Row] = [
        (name, cost.factor.text(), cost.step_us.text(), PLANT_FLOORS[name], cost.physics_us.text())
        for name, cost in results.items()
    ]
    head = (
        "missions/square.plan, three processes, 500 Hz",
        "× real time",
        "µs a step",
        "mark",
        "µs a physics step",
    )
    return table("PLANTS", head, rows)


def _costs(results: dict[str, Any]) -> str:
    costs: list[tuple[Part, Figure]] = results["costs"]
    rows: list[Row] = []
    trip, _ = results["round_trips"][WAYS[0].name]
    floor_us = trip.median
    rows.append(("TCP round trip, both ends on one processor", trip.text(), "1", short(floor_us)))
    for part, cost in costs:
        share_us = cost.median * part.per_step
        if part.is_floor:
            floor_us += share_us
            rows.append((part.name, cost.text(), f"{part.per_step:g}", short(share_us)))
    rows.append(("floor of a step, two processes", "", "", short(floor_us)))
    if "three_processes" in results:
        step_us = results["three_processes"][three_processes.ON_TRUTH].step_us.median
        rows.append(("a step as flown, three processes", "", "", short(step_us)))
    rows.append(("for comparison, or made of parts above",))
    rows.extend(
        (f"  {part.name}", cost.text(), f"{part.per_step:.2g}", short(cost.median * part.per_step))
        for part, cost in costs
        if not part.is_floor
    )
    by_name = {part.name: cost.median for part, cost in costs}
    ratio = by_name[step_costs.PACK_BY_PYMAVLINK] / by_name[step_costs.PACK]
    rows.append(("  telemetry: pymavlink's time, times ours", short(ratio, 2)))
    return table("PARTS OF A STEP, 500 and 100 Hz", ("", "µs each", "a step", "µs a step"), rows)


def _round_trips(trips: dict[str, tuple[Figure, Figure]]) -> str:
    rows = [(name, median.text(), mean.text()) for name, (median, mean) in trips.items()]
    title = (
        f"TCP ROUND TRIP between two processes, {PlantStateFrame().size} and {ActuatorsFrame().size} bytes"
    )
    return table(title, ("", "median, µs", "mean, µs"), rows)


def _lateness(figures: dict[str, list[float]], has_compiler: bool) -> str:
    head = ("", *(f"p{p:g}" if p < 100.0 else "max" for p in PERCENTILES))
    rows = [(name, *(short(value) for value in values)) for name, values in figures.items()]
    text = table("LATENESS IN REAL TIME at 500 Hz, µs", head, rows)
    return text if has_compiler else text + "\n  (no C compiler here: the loop in C was left out)"


def _load(results: dict[str, Seen]) -> str:
    none = next(iter(results.values()))
    rows: list[Row] = [
        (
            name,
            short(seen.late_p50_us),
            short(seen.late_p99_us),
            short(seen.late_p99_us / none.late_p99_us, 2),
            short(seen.tick_p50_us),
            short(seen.tick_p99_us),
            short(seen.tick_max_us),
            f"{seen.overruns}",
            f"{seen.missed}",
            f"{seen.ticks}",
            short(seen.frames_hz),
        )
        for name, seen in results.items()
    ]
    head = ("", "late p50", "p99", "× none", "turn p50", "p99", "max", "overruns", "missed", "of", "frames/s")
    return table("GROUND LINKS in real time at 500 Hz, µs", head, rows)


def _transfers(taken: Transfers) -> str:
    floor_s = taken.floor_s.median
    rows: list[Row] = [
        (f"{ITEMS} mission items, upload", taken.upload_s.text(), short(taken.upload_s.median / floor_s, 2)),
        (
            f"{ITEMS} mission items, download",
            taken.download_s.text(),
            short(taken.download_s.median / floor_s, 2),
        ),
        (
            f"{ITEMS} mission items, comparison",
            taken.compare_s.text(),
            short(taken.compare_s.median / floor_s, 2),
        ),
        (
            f"{taken.parameters} parameters",
            taken.parameters_s.text(),
            short(taken.parameters_s.median / floor_s, 2),
        ),
        (f"floor: {ITEMS} round trips of datagrams", taken.floor_s.text(), "1"),
    ]
    return table("TRANSFERS over loopback, vehicle at real-time speed", ("", "s", "× floor"), rows)


def _start(results: dict[str, Any]) -> str:
    rows: list[Row] = [(name, took.text()) for name, took in results["start"].items()]
    return table("START", ("", "s"), rows)


def _startup(taken: Startup) -> str:
    rows: list[Row] = [("python -c pass", taken.python_cpu_s.text(), "", "")]
    rows += [(f"gcs {name}", cpu_s.text(), "", "") for name, cpu_s in taken.help_cpu_s.items()]
    rows += [
        (f"gcs {name}", cpu_s.text(), taken.answer_s[name].text(), taken.all_s[name].text())
        for name, cpu_s in taken.answer_cpu_s.items()
    ]
    head = ("", "processor time, s", "after the heartbeat, s", "all of it, s")
    return table("COMMANDS OF GCS: processor time, and time of an answer", head, rows)


def _watched(seen: Watched) -> str:
    rows: list[Row] = [
        (title, *(shares[size].text(2) for size in SIZES)) for title, shares in seen.shares_percent.items()
    ]
    title = f"GCS WATCH, {seen.messages_hz:.0f} messages a second: processor time, % of a core"
    return table(title, ("", *(f"{columns}x{rows}" for columns, rows in SIZES)), rows)


_SECTIONS: tuple[tuple[str, Callable[[dict[str, Any]], str]], ...] = (
    ("three_processes", _flights),
    ("campaigns", lambda results: _campaigns(results["campaigns"])),
    ("peers", lambda results: _peers(results["peers"])),
    ("emulated", lambda results: _emulated(results["emulated"])),
    ("plants", lambda results: _plants(results["plants"])),
    ("costs", _costs),
    ("round_trips", lambda results: _round_trips(results["round_trips"])),
    ("lateness", lambda results: _lateness(*results["lateness"])),
    ("load", lambda results: _load(results["load"])),
    ("transfers", lambda results: _transfers(results["transfers"])),
    ("start", _start),
    ("startup", lambda results: _startup(results["startup"])),
    ("watch", lambda results: _watched(results["watch"])),
)
"""The key of each section's figures, and what writes it."""


def plain(results: dict[str, Any]) -> dict[str, Any]:
    """Return the results as values that JSON knows."""
    out = dict(results)
    if "costs" in out:
        out["costs"] = {
            part.name.strip(): {"us": cost._asdict(), "per_step": part.per_step}
            for part, cost in out["costs"]
        }
    if "lateness" in out:
        out["lateness"] = {
            name: dict(zip(map(str, PERCENTILES), values, strict=True))
            for name, values in out["lateness"][0].items()
        }
    return _plain(out)  # type: ignore[no-any-return]


def _plain(value: Any) -> Any:
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, tuple):  # of a real-time factor and a step, or of median and mean
        return [_plain(item) for item in value]
    return value
