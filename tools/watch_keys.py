"""The page of docs/reference with the keys of ``gcs watch``, from the bindings of its screens."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from textual.binding import Binding
from textual.keys import format_key

from flightstack.mavlink.dialect import mavlink
from gcs_cli.tui.app import WatchApp
from gcs_cli.tui.orders.orders import ORDERS, Field
from gcs_cli.tui.screens import SCREENS
from gcs_cli.vehicle.view_types import Identity, VehicleView

_PX4 = VehicleView(identity=Identity(1, 1, mavlink.MAV_TYPE_QUADROTOR, mavlink.MAV_AUTOPILOT_PX4))


def keys_page(note: str) -> str:
    """Return the page."""
    lines = ["# Keys of gcs watch", "", note, "", "Capital letters command the vehicle, on every screen:", ""]
    lines += ["| key | order | effect | values |", "|---|---|---|---|"]
    for order in ORDERS:
        values = ", ".join(field.name + _omission(field) for field in order.fields)
        lines.append(f"| `{order.key}` | {order.title} | {order.help} | {values} |")
    lines += ["", "On every screen:", "", "| key | effect |", "|---|---|"]
    lines += [f"| `{entry.key}` | Screen {entry.title}: {entry.summary} |" for entry in SCREENS]
    orders = {order.key for order in ORDERS} | {entry.key for entry in SCREENS}
    lines += _rows(binding for binding in WatchApp.BINDINGS if binding.key not in orders)
    for entry in SCREENS:
        own = [binding for binding in type(entry.load()).BINDINGS if binding.key not in orders]
        if own:
            lines += ["", f"On {entry.title}:", "", "| key | effect |", "|---|---|", *_rows(own)]
    return "\n".join(lines) + "\n"


def _omission(field: Field) -> str:
    """Return a note if the value may be omitted."""
    if field.is_optional(VehicleView()):
        return " (optional)"
    return f" (optional on PX4, empty: {field.omitted})" if field.is_optional(_PX4) else ""


def _rows(bindings: Iterable[Any]) -> list[str]:
    made = [binding if isinstance(binding, Binding) else Binding(*binding) for binding in bindings]
    return [f"| {_keys(binding.key)} | {binding.tooltip or binding.description} |" for binding in made]


def _keys(keys: str) -> str:
    return " ".join(f"`{format_key(key).replace('|', '&#124;')}`" for key in keys.split(","))
