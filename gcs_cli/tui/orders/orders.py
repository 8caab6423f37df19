"""Commands to a vehicle in the terminal view: key, title, values, confirmation, action. Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from flightstack.core.errors import plain
from gcs_cli.actions import in_flight, on_vehicle
from gcs_cli.actions.action import Action
from gcs_cli.vehicle.view_types import VehicleView


class FieldError(Exception):
    """A value that the user typed is not valid; one sentence."""


class Field(NamedTuple):
    """A value that the user types."""

    name: str
    unit: str = ""
    default: str = ""
    smallest: float = -1e9
    largest: float = 1e9
    is_optional: Callable[[VehicleView], bool] = lambda _view: False
    """True if this vehicle does not need the value."""
    omitted: str = ""
    """Value that the vehicle uses if this one is omitted."""
    choices: Callable[[VehicleView], Sequence[str]] | None = None
    """The valid words; None: a number."""

    def parse(self, text: str, view: VehicleView) -> Any:
        """Return the value of ``text``, None for an omitted one; raise ``FieldError``."""
        text = text.strip()
        if not text:
            if self.is_optional(view):
                return None
            raise FieldError(f"{self.name}: give a value")
        if self.choices is not None:
            known = {choice.lower(): choice for choice in self.choices(view)}
            if text.lower() not in known:
                raise FieldError(f"{self.name}: choose one of {', '.join(known.values())}")
            return known[text.lower()]
        try:
            value = float(text)
        except ValueError:
            raise FieldError(f"{self.name}: {text} is not a number") from None
        if not self.smallest <= value <= self.largest:
            raise FieldError(f"{self.name}: give {plain(self.smallest)} to {plain(self.largest)}")
        return value


class Order(NamedTuple):
    """An entry of the command palette that acts on the vehicle."""

    name: str
    key: str
    title: str
    help: str
    make: Callable[..., Action]
    """Returns the action; its arguments are the values of ``fields``."""
    fields: tuple[Field, ...] = ()
    question: Callable[[VehicleView], str] = lambda _view: ""
    """Question to confirm, because the order is dangerous in this state; empty: none."""
    applies: Callable[[VehicleView], bool] = lambda _view: True
    """True if the order makes sense in this state."""
    in_footer: bool = False


def vehicle_name(view: VehicleView) -> str:
    """Return the type and system id of the vehicle."""
    return "the vehicle" if view.identity is None else f"{view.identity.kind} {view.identity.system_id}"


def in_air(view: VehicleView) -> bool:
    """Return True if the vehicle flies, or does not report that it is on the ground while armed."""
    return view.armed and view.on_ground is not True


def goes_on(view: VehicleView) -> bool:
    """Return True unless the flight has ended for good."""
    return not view.terminated_for_good


def _flies(view: VehicleView) -> bool:
    return in_air(view) and goes_on(view)


def takes_orders(view: VehicleView) -> bool:
    """Return True if the vehicle is armed and takes orders for its flight."""
    return view.armed and goes_on(view)


def _asks_to_arm(view: VehicleView) -> str:
    return f"Arm {vehicle_name(view)}? The rotors start."


def _asks_to_disarm(view: VehicleView) -> str:
    return f"Disarm {vehicle_name(view)} in the air? The rotors stop and it falls." if in_air(view) else ""


def _asks_to_reboot(view: VehicleView) -> str:
    return f"Reboot {vehicle_name(view)}?"


def _asks_to_terminate(view: VehicleView) -> str:
    if view.terminated_for_good:
        return ""
    return f"Terminate the flight of {vehicle_name(view)}? The rotors stop at once, in the air too."


def asks_to_start(view: VehicleView) -> str:
    """Return the question before the mission starts on the ground."""
    return "" if in_air(view) else f"Start the mission? {vehicle_name(view).capitalize()} arms and takes off."


def question_for(
    title: str, targets: Sequence[VehicleView], ask: Callable[[VehicleView], str], total: int
) -> str:
    """Return the question before an action on ``targets``, of ``total`` vehicles on the link; empty: none.

    ``ask`` returns the question for a single vehicle. An action on several of them is always confirmed.
    """
    questions = [question for view in targets if (question := ask(view))]
    if total == 1:
        return "\n".join(questions)
    ids = ", ".join(str(view.identity.system_id) for view in targets if view.identity is not None)
    count = f"all {total}" if len(targets) == total else f"{len(targets)} of {total}"
    return "\n".join([f"{title}: {count} vehicles ({ids})?", *questions])


def _always(_view: VehicleView) -> bool:
    return True


def _has_takeoff_altitude(view: VehicleView) -> bool:
    return view.autopilot.has_takeoff_altitude


_ALTITUDE = Field("altitude", "m above home", smallest=0.1, largest=10_000.0, is_optional=_always)
ORDERS = (
    Order(
        "arm",
        "A",
        "Arm",
        "Start the rotors",
        on_vehicle.arm,
        (),
        _asks_to_arm,
        lambda view: not view.armed and goes_on(view),
        True,
    ),
    Order(
        "disarm",
        "D",
        "Disarm",
        "Stop the rotors; in the air too, after a question",
        on_vehicle.disarm,
        (),
        _asks_to_disarm,
        lambda view: view.armed,
        True,
    ),
    Order(
        "takeoff",
        "T",
        "Take off",
        "Arm and climb to an altitude above the ground",
        in_flight.takeoff,
        (_ALTITUDE._replace(default="5", is_optional=_has_takeoff_altitude, omitted="the vehicle's own"),),
        applies=lambda view: not in_air(view) and goes_on(view),
        in_footer=True,
    ),
    Order("hold", "H", "Hold", "Hold the position", in_flight.hold, applies=_flies, in_footer=True),
    Order("land", "L", "Land", "Land here", in_flight.land, applies=_flies, in_footer=True),
    Order(
        "return",
        "R",
        "Return",
        "Return to launch and land",
        in_flight.return_to_launch,
        applies=_flies,
        in_footer=True,
    ),
    Order(
        "goto",
        "G",
        "Go to",
        "Fly to a position and hold there",
        in_flight.goto,
        (
            Field("latitude", "°", smallest=-90.0, largest=90.0),
            Field("longitude", "°", smallest=-180.0, largest=180.0),
            _ALTITUDE,
        ),
        applies=takes_orders,
    ),
    Order(
        "speed",
        "S",
        "Speed",
        "Set the ground speed; without a value, the default",
        in_flight.speed,
        (Field("speed", "m/s", smallest=0.1, largest=100.0, is_optional=_always),),
        applies=goes_on,
    ),
    Order(
        "yaw",
        "Y",
        "Turn",
        "Turn to a heading",
        in_flight.yaw,
        (Field("heading", "° clockwise from north", smallest=0.0, largest=360.0),),
        applies=takes_orders,
    ),
    Order(
        "mission",
        "C",
        "Start mission",
        "Start the mission, or continue it in the air",
        in_flight.start_mission,
        (),
        asks_to_start,
        goes_on,
    ),
    Order(
        "mode",
        "M",
        "Mode",
        "Select a flight mode",
        on_vehicle.select_mode,
        (Field("mode", choices=lambda view: list(on_vehicle.mode_choices(view))),),
        applies=goes_on,
    ),
    Order(
        "sethome",
        "O",
        "Set home here",
        "Make this position home",
        on_vehicle.set_home,
        (),
        lambda view: f"Make the present position of {vehicle_name(view)} its home? It returns there.",
    ),
    Order(
        "inject",
        "F",
        "Inject a failure",
        "Make a part of the vehicle fail",
        lambda unit, failure, instance: on_vehicle.inject_failure(unit, failure, int(instance or 0)),
        (
            Field("part", choices=lambda _view: list(on_vehicle.failure_units())),
            Field("failure", choices=lambda _view: list(on_vehicle.failure_types())),
            Field("instance", "0: all", smallest=0.0, largest=255.0, is_optional=_always),
        ),
        lambda view: f"Inject a failure into {vehicle_name(view)}? It may crash.",
    ),
    Order("reboot", "B", "Reboot", "Reboot the vehicle", on_vehicle.reboot, (), _asks_to_reboot),
    Order(
        "terminate",
        "X",
        "Terminate",
        "End the flight at once: the rotors stop",
        on_vehicle.terminate,
        (),
        _asks_to_terminate,
    ),
)


def order_named(name: str) -> Order:
    """Return the order of that name."""
    return next(order for order in ORDERS if order.name == name)


def action_of(order: Order, values: Sequence[Any], view: VehicleView) -> Action:
    """Return the action; a confirmed disarm in the air is forced."""
    if order.name == "disarm":
        return on_vehicle.disarm(force=in_air(view))
    return order.make(*values)
