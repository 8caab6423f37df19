"""A list over a screen: the vehicles on the link."""

from __future__ import annotations

from typing import ClassVar

from textual.app import ComposeResult
from textual.binding import Binding
from textual.widgets import OptionList
from textual.widgets.option_list import Option

from gcs_cli.tui.fly.panels import height_m
from gcs_cli.tui.watch_screen import LiveDialog
from gcs_cli.tui.widgets.drawing import watch_app
from gcs_cli.vehicle.field_units import UNKNOWN, number
from gcs_cli.vehicle.view_types import VehicleView

ALL = 0
"""Result if the orders go to all vehicles; no system has this id."""


class VehicleList(LiveDialog[int | None]):
    """Asks for a vehicle; the result is its system id, ``ALL``, or None."""

    DEFAULT_CSS = """
    VehicleList { align: center middle; }
    VehicleList OptionList { width: 64; max-width: 90%; height: auto; max-height: 80%; border: round $accent; }
    """
    AUTO_FOCUS = "OptionList"
    BINDINGS: ClassVar = [Binding("escape", "cancel", "Cancel")]

    def compose(self) -> ComposeResult:
        """Yield the list."""
        listed = OptionList(*self._options(), markup=False)
        listed.border_title = "Vehicles"
        yield listed

    def _options(self) -> list[Option]:
        feed = watch_app(self).feed
        return _options(feed.views, feed.now_s)

    def follow(self) -> None:
        """Show the vehicles of now; the selected one stays selected."""
        if not self.is_mounted:  # it was opened just now
            return
        listed = self.query_one(OptionList)
        options = self._options()
        if [option.prompt for option in options] == [option.prompt for option in listed.options]:
            return
        before = None if listed.highlighted_option is None else listed.highlighted_option.id
        listed.set_options(options)
        listed.highlighted = next(
            (index for index, option in enumerate(options) if option.id == before), listed.highlighted
        )

    def on_option_list_option_selected(self, event: OptionList.OptionSelected) -> None:
        """End with the vehicle."""
        self.dismiss(int(event.option_id or ALL))

    def action_cancel(self) -> None:
        """End without a choice."""
        self.dismiss(None)


def _options(views: tuple[VehicleView, ...], now_s: float) -> list[Option]:
    options = [Option(vehicle_line(view, now_s), id=str(_system_id(view))) for view in views]
    if len(options) > 1:
        options.append(Option("all of them: actions go to every vehicle", id=str(ALL)))
    return options


def vehicle_line(view: VehicleView, now_s: float) -> str:
    """Return a vehicle's state in one line."""
    kind = "vehicle" if view.identity is None else view.identity.kind
    state = "lost" if view.lost(now_s) else "armed" if view.armed else "disarmed"
    return f"{_system_id(view):>3}  {kind:<10} {view.mode or UNKNOWN:<10} {state:<9}{number(height_m(view), 1):>7} m"


def _system_id(view: VehicleView) -> int:
    return 0 if view.identity is None else view.identity.system_id
