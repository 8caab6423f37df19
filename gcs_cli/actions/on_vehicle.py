"""Actions on the vehicle itself: arm, disarm, mode, home, termination, failure injection, reboot. Pure."""

from __future__ import annotations

from flightstack.mavlink.dialect import mavlink
from gcs_cli.actions.action import Action, ActionError, Step
from gcs_cli.actions.progress import horizontal_m
from gcs_cli.autopilots import common_commands
from gcs_cli.autopilots.autopilot import VehicleCommand, plain_name
from gcs_cli.vehicle.view_types import GeoPosition, VehicleView

HOME_TOLERANCE_M = 3.0
"""Largest distance of a home that was set to the present position; both come from the same estimator."""
REBOOT_LIMIT_S = 60.0
UP_S = 2.0
"""Least time since boot for a reboot: its first message after the restart has a smaller one."""


def arm() -> Action:
    """Arm the vehicle."""
    return Action("arm", lambda _view: (arm_step(),), "arming", "armed")


def arm_step() -> Step:
    """Return the step that arms."""
    return Step("arming", common_commands.ARM, lambda view: view.armed, "is not armed")


def disarm(*, force: bool = False) -> Action:
    """Disarm the vehicle; with ``force`` in the air too."""
    command = common_commands.FORCE_DISARM if force else common_commands.DISARM
    step = Step("disarming", command, lambda view: not view.armed, "is still armed")
    return Action(
        "disarm", lambda _view: (step,), "disarming", "disarmed", {"force": force}, goes_on_without_link=True
    )


def select_mode(name: str) -> Action:
    """Select a flight mode by its name or number."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        return (mode_step(view, name),)

    return Action(
        "mode", plan, f"selecting mode {name.lower()}", f"mode {name.lower()}", {"mode": name.upper()}
    )


def mode_step(view: VehicleView, name: str) -> Step:
    """Return the step that selects a mode; raise ``ActionError`` if the vehicle has none of that name."""
    number = find_mode(view, name)
    if number is None:
        names = ", ".join(mode_choices(view))
        raise ActionError(f"the vehicle has no mode {name}" + (f"; choose one of {names}" if names else ""))
    return Step(
        f"mode {name.lower()}",
        view.autopilot.select_mode(number),
        lambda view: view.custom_mode == number,
        "is not in that mode",
    )


def find_mode(view: VehicleView, name: str) -> int | None:
    """Return the custom mode of a name, the autopilot's or the vehicle's own in AVAILABLE_MODES, or of its number."""
    if name.isascii() and name.isdecimal():
        return _numbered(view, int(name))
    number = view.autopilot.mode_number(name, view.vehicle_type)
    if number is not None:
        return number
    wanted = plain_name(name)
    return next((mode.number for mode in view.modes if plain_name(mode.label) == wanted), None)


def _numbered(view: VehicleView, number: int) -> int | None:
    """Return the number of a mode if the vehicle may have it: any one if neither table nor vehicle lists modes."""
    known = {*view.autopilot.mode_names(view.vehicle_type), *(mode.number for mode in view.modes)}
    return number if number in (known or range(2**32)) else None


def mode_choices(view: VehicleView) -> dict[str, int]:
    """Return the modes that a user may select, by name: those that the vehicle lists, else the autopilot's."""
    autopilot, kind = view.autopilot, view.vehicle_type
    if view.modes and len(view.modes) >= view.mode_total:
        listed = {mode.number: mode.label.upper() for mode in view.modes if mode.is_selectable}
        return {autopilot.mode_name(kind, number) or label: number for number, label in listed.items()}
    names = autopilot.mode_names(kind)
    return {name: number for number, name in names.items() if autopilot.selectable(kind, number)}


def set_home(place: tuple[float, float, float] | None = None) -> Action:
    """Set home to latitude, longitude and altitude above mean sea level; None: to the present position."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        before = view.home_count
        target = view.geo if place is None else GeoPosition(*place, 0.0)

        def is_there(view: VehicleView) -> bool:
            home = view.home
            if home is None or view.home_count == before:
                return False
            return target is None or horizontal_m(home, target) < HOME_TOLERANCE_M

        command = common_commands.HOME_HERE if place is None else common_commands.set_home(*place)
        request = common_commands.request_message(mavlink.MAVLINK_MSG_ID_HOME_POSITION)
        return (
            Step("set-home", command, None),
            Step("home position", request, is_there, "reports another home position"),
        )

    where = "the present position" if place is None else f"{place[0]:.7f} {place[1]:.7f} {place[2]:g} m"
    return Action("set-home", plan, f"setting home to {where}", f"home is {where}", {"home": place})


def terminate() -> Action:
    """End the flight at once: the rotors stop, in the air too."""
    step = Step(
        "termination",
        common_commands.TERMINATE,
        lambda view: view.terminated or not view.armed,
        "is still armed",
        reached_before=lambda view: view.terminated_for_good,  # PX4 refuses a second termination
    )
    doing, done = "terminating the flight", "flight terminated"
    return Action("terminate", lambda _view: (step,), doing, done, goes_on_without_link=True)


def inject_failure(unit: str, failure: str, instance: int = 0) -> Action:
    """Inject a failure; the names are those of FAILURE_UNIT and FAILURE_TYPE without their prefixes."""
    units, failures = failure_units(), failure_types()

    def plan(_view: VehicleView) -> tuple[Step, ...]:
        command = common_commands.inject_failure(
            _chosen(units, unit, "unit"), _chosen(failures, failure, "failure"), instance
        )
        return (Step("failure injection", command, None),)

    which = f"{unit} {instance}" if instance else unit
    facts = {"unit": unit, "failure": failure, "instance": instance}
    text = f"failure of {which}: {failure}"
    return Action("inject", plan, text, text, facts, unseen="the vehicle does not report its effect")


def failure_units() -> dict[str, int]:
    """Return the numbers of FAILURE_UNIT by their names as a user writes them: ``motor``, ``gps``."""
    return {
        name.removeprefix("sensor_").removeprefix("system_"): number
        for name, number in _entries("FAILURE_UNIT").items()
    }


def failure_types() -> dict[str, int]:
    """Return the numbers of FAILURE_TYPE by their names as a user writes them: ``off``, ``stuck``."""
    return _entries("FAILURE_TYPE")


def _entries(enum: str) -> dict[str, int]:
    named = {entry.name.removeprefix(f"{enum}_"): number for number, entry in mavlink.enums[enum].items()}
    return {name.lower(): number for name, number in named.items() if name != "ENUM_END"}


def _chosen(numbers: dict[str, int], name: str, what: str) -> int:
    number = numbers.get(name.lower())
    if number is None:
        raise ActionError(f"there is no {what} {name}; choose one of {', '.join(numbers)}")
    return number


def reboot() -> Action:
    """Reboot the vehicle, and wait until it is back."""

    def plan(view: VehicleView) -> tuple[Step, ...]:
        before = view.restarts
        command: VehicleCommand = common_commands.REBOOT
        if not _has_running_clock(view):  # such as a vehicle without its simulator: nothing shows its restart
            return (Step("reboot", command, None),)
        return (
            Step(
                "reboot",
                command,
                lambda view: view.restarts > before,
                "has not restarted",
                REBOOT_LIMIT_S,
                restarts=True,
            ),
        )

    return Action(
        "reboot",
        plan,
        "rebooting",
        "rebooted",
        needs=lambda view: view.time_s is not None and view.time_s >= UP_S,
        needs_text=f"it booted less than {UP_S:g} s ago, so that its restart would not be seen: repeat the command",
        does_without=lambda view: not _has_running_clock(view),
        unseen="its clock does not run, so that its restart is not seen",
    )


def _has_running_clock(view: VehicleView) -> bool:
    return view.time_s is not None and view.time_s > 0.0


def set_message_rate(message_id: int, name: str, rate_hz: float | None) -> Action:
    """Request a message at a rate; 0 stops it, None is the vehicle's default. No vehicle reports the effect."""
    rate = "its default rate" if rate_hz is None else f"{rate_hz:g} Hz" if rate_hz else "no rate: stopped"
    step = Step(f"rate of {name}", common_commands.message_interval(message_id, rate_hz), None)
    facts = {"message": name, "rate_hz": rate_hz}
    return Action("message rate", lambda _view: (step,), f"{name} at {rate}", f"{name} at {rate}", facts)
