"""The paper's processor in the loop (Fig. 15): both controllers fly a mission with their loops on a target.

It runs ``gcs pil`` for each controller with the paper's gains and rates, on a mission with a waypoint at the end of
each move of the desired trajectory. The result holds no wall-clock time, so it repeats bit for bit.
"""

from __future__ import annotations

import io
import math
import shutil
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from flightstack.core.contract import Vector3
from flightstack.core.geodesy import LocalFrame
from flightstack.params.config import DEFAULT_HOME, TRUTH
from flightstack.plan import Command, Frame, MissionItem, Plan, save_plan
from flightstack.transports.udp import PortBusyError, UdpSocket
from gcs_cli.errors import USAGE, CliError
from gcs_cli.experiments.paper.flights.trajectory import Trajectory, load_trajectory, sample
from gcs_cli.fly.fly_flags import FlyOptions
from gcs_cli.fly.fly_options import check_ports, checked_plan
from gcs_cli.pil.run import JSON_NAME, Finished
from gcs_cli.pil.run import run as run_pil
from gcs_cli.pil.targets import check_there, checked_target, meaning
from gcs_cli.report.flight_outcome import Code

EMULATED = "emulated"
CONTROLLERS = ("pid", "backstepping")
GAINS, INNER_HZ, OUTER_HZ = "paper", 1000.0, 250.0
PLANT, RIGID = "paper", "rigid"
"""The paper's own, and the one with all angles and the spin-up torque."""
FLOWN = (("pid", PLANT), ("backstepping", PLANT), ("backstepping", RIGID))
"""Controllers, and the plants that they fly on."""
WHY_SO = (
    "It is a mission, as a pilot uploads it, and not the trajectory of Fig. 7 itself: the vehicle's own guidance flies "
    "from waypoint to waypoint. The plant is the paper's; backstepping flies the rigid body as well, and the PID does "
    "not: there, where rotors react when they spin up, Table II's yaw loop is unstable, oscillates on the ground "
    "before takeoff, and causes flights that were one rounding apart rise at different times."
)
TRAJECTORY = "desired"
_FIRST_INSTANCE = 90
_LEAST_LEG_M = 0.3
_LEAST_HEIGHT_M = 1.0
_PARTS = ("verdict", "checks", "differences", "compared", "profile", "target", "stack")
_OF_FLIGHT = ("outcome", "loops", "ticks", "airborne_ticks", "sim_time_s")


def left_out(why: str, target: str = EMULATED) -> dict[str, Any]:
    """Return the section of ``results.json`` without flights, with the reason."""
    return {
        "target": target,
        "why_left_out": why,
        "meaning": "",
        "mission": "",
        "controllers": {},
        "rigid": {},
    }


def problem(target: str = EMULATED) -> str | None:
    """Return the reason that the target cannot fly, or None. Raise CliError for a wrong name."""
    choice = checked_target(target)
    try:
        for controller in CONTROLLERS:
            check_there(choice, controller)
    except CliError as error:
        return str(error)
    return None


def run(
    folder: Path,
    target: str = EMULATED,
    tell: Callable[[str], None] | None = None,
    instance: int | None = None,
) -> dict[str, Any]:
    """Fly MIL, SIL and PIL with both controllers; leave each comparison in a folder that ``folder_name`` names.

    Without the tools of the emulated target the section has the reason instead. A missing board raises CliError, Ctrl-C
    raises KeyboardInterrupt. ``tell`` is called with the next step; ``instance`` shifts the
    ports, None chooses free ones.
    """
    why = problem(target)
    if why is not None:
        if target != EMULATED:
            raise CliError(why, USAGE)
        return left_out(why, target)
    plan = mission_along(load_trajectory(TRAJECTORY))
    found: dict[str, dict[str, Any]] = {PLANT: {}, RIGID: {}}
    for controller, plant in FLOWN:
        if tell is not None:
            tell(f"processor in the loop: {controller}{'' if plant == PLANT else ', ' + plant}")
        finished = _fly(folder, controller, target, plan, instance, plant)
        if finished.problem is not None and finished.problem.exit_code == USAGE:
            raise finished.problem
        found[plant][controller] = repeatable(finished.outcome.result)
    return {
        "target": target,
        "why_left_out": None,
        "meaning": meaning(checked_target(target)),
        "mission": _about(plan),
        "why_so": WHY_SO,
        "gains": GAINS,
        "plant": PLANT,
        "inner_hz": INNER_HZ,
        "outer_hz": OUTER_HZ,
        "controllers": found[PLANT],
        "rigid": found[RIGID],
    }


def clear(folder: Path) -> None:
    """Delete the comparisons that a previous run left in ``folder``."""
    for controller, plant in FLOWN:
        kept = folder / folder_name(controller, plant)
        if (kept / JSON_NAME).exists():
            shutil.rmtree(kept, ignore_errors=True)


def mission_along(trajectory: Trajectory) -> Plan:
    """Return a mission: takeoff, a waypoint with heading at the end of each move of the trajectory, landing."""
    ends = sorted({move.at_s + move.over_s for move in trajectory.moves})
    at = sample(trajectory, np.array([*ends, trajectory.duration_s])).value
    corners: list[tuple[float, float, float, float]] = []
    for north, east, due_down, yaw in at.tolist():
        down = min(due_down, -_LEAST_HEIGHT_M)
        if not corners or math.dist(corners[-1][:3], (north, east, down)) >= _LEAST_LEG_M:
            corners.append((north, east, down, yaw))
    north, east, down, yaw = corners[-1]
    items = [_item(Command.NAV_TAKEOFF, (0.0, 0.0, corners[0][2], math.nan))]
    items += [_item(Command.NAV_WAYPOINT, corner) for corner in corners]
    items.append(_item(Command.NAV_LAND, (north, east, 0.0, math.nan)))
    return Plan(tuple(items), DEFAULT_HOME)


def _item(command: Command, place: tuple[float, float, float, float]) -> MissionItem:
    north, east, down, yaw = place
    there = LocalFrame(DEFAULT_HOME).to_geo(Vector3(north, east, down))
    x, y = round(there.latitude_deg * 1e7), round(there.longitude_deg * 1e7)
    yaw_deg = math.degrees(yaw) % 360.0 if math.isfinite(yaw) else math.nan
    return MissionItem(command, Frame.GLOBAL_RELATIVE_ALT, 0.0, 0.0, 0.0, yaw_deg, x, y, -down)


def _about(plan: Plan) -> str:
    corners = sum(item.command == Command.NAV_WAYPOINT for item in plan.items)
    return f"takeoff, {corners} waypoints where a move of the desired trajectory ends, landing"


def folder_name(controller: str, plant: str) -> str:
    """Return the name of the folder of a comparison."""
    return f"pil-{controller}" if plant == PLANT else f"pil-{controller}-{plant}"


def _fly(
    folder: Path, controller: str, target: str, plan: Plan, instance: int | None, plant: str = PLANT
) -> Finished:
    """Fly, then replace the results of a previous run at once."""
    kept = folder / folder_name(controller, plant)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".pil-") as workshop:
        path = Path(workshop) / f"{TRAJECTORY}.plan"
        save_plan(path, plan)
        options = FlyOptions(
            path, controller, GAINS, plant, inner_hz=INNER_HZ, outer_hz=OUTER_HZ, state=TRUTH,
            instance=_free_instance() if instance is None else instance,
        )  # fmt: skip
        console = Console(emoji=False, file=io.StringIO())
        finished = run_pil(options, checked_plan(options), target, Path(workshop) / "flights", console)
        outcomes = [flight["outcome"] for flight in finished.outcome.result["flights"].values()]
        if Code.INTERRUPTED in outcomes:
            raise KeyboardInterrupt  # in a flight Ctrl-C lands; here it ends the command
        if (kept / JSON_NAME).exists():
            shutil.rmtree(kept)
        if not kept.exists():
            finished.folder.rename(kept)
    return finished


def _free_instance() -> int:
    """Return an instance with free ports."""
    for instance in range(_FIRST_INSTANCE, _FIRST_INSTANCE + 10):
        options = FlyOptions(Path(), instance=instance)
        try:
            check_ports(options)
            UdpSocket("127.0.0.1", options.gcs_port).close()
        except (CliError, PortBusyError):
            continue
        return instance
    raise CliError("the ports of ten instances are all in use: end the programs that use them", USAGE)


def repeatable(result: dict[str, Any]) -> dict[str, Any]:
    """Return the parts of a result that repeat: without wall-clock times and link counters."""
    flights = {
        stage: {name: flight[name] for name in _OF_FLIGHT} for stage, flight in result["flights"].items()
    }
    return {**{name: result[name] for name in _PARTS}, "flights": flights}
