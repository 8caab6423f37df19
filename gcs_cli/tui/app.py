"""The application of ``gcs watch``: screens by key, redrawing, and what the user asks of the vehicle."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from typing import Any, ClassVar, Literal

from textual import work
from textual.app import App, SystemCommand
from textual.binding import Binding
from textual.driver import Driver
from textual.events import Event, InputEvent, Paste, Resize
from textual.screen import Screen
from textual.theme import Theme

from flightstack.core.enums import Severity
from gcs_cli.actions.action import Action
from gcs_cli.tui.feed import Feed
from gcs_cli.tui.input import KeyQueue, TerminalDriver
from gcs_cli.tui.mission.plan_fetcher import PlanFetcher
from gcs_cli.tui.orders.form import Confirm, OrderForm
from gcs_cli.tui.orders.orders import ORDERS, action_of, order_named, question_for
from gcs_cli.tui.orders.vehicle_list import ALL, VehicleList
from gcs_cli.tui.palette import DARK, LIGHT, Palette, monochrome, palette_of
from gcs_cli.tui.plot.fields import PlotFields
from gcs_cli.tui.screens import SCREENS
from gcs_cli.tui.watch_screen import LiveDialog, WatchScreen
from gcs_cli.vehicle.view_types import VehicleView


def _theme(name: str, colours: Palette, dark: bool) -> Theme:
    return Theme(
        name=name,
        primary=colours.accent,
        secondary=colours.target,
        accent=colours.accent,
        success=colours.good,
        warning=colours.warning,
        error=colours.bad,
        foreground=colours.text,
        background=colours.background,
        surface=colours.surface,
        panel=colours.surface,
        dark=dark,
    )


THEMES = (_theme("gcs-dark", DARK, dark=True), _theme("gcs-light", LIGHT, dark=False))


REDRAWS_HZ = 5.0
"""Redraws of the screen a second. Fly at 200x50 takes 7.4 % of a core, about half of it for them."""
COVERED_EVERY = 4
"""A screen below a dialog is drawn in one of so many redraws: Textual then composes all of both screens. An even
number, because parts of a screen are drawn in every other redraw."""
_ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class WatchApp(App[None]):
    """Shows the vehicles of ``feed`` until the user quits, or the link fails: then ``feed.error`` is set."""

    TITLE = "gcs watch"
    CSS_PATH = "watch.tcss"
    MODES: ClassVar[dict[str, str | Callable[[], Screen[Any]]]] = {
        entry.mode: entry.load for entry in SCREENS
    }
    DEFAULT_MODE = SCREENS[0].mode
    AUTO_FOCUS = None
    BINDINGS: ClassVar = [
        *(
            Binding(entry.key, f"app.switch_mode('{entry.mode}')", entry.title, show=False)
            for entry in SCREENS
        ),
        *(Binding(order.key, f"order('{order.name}')", order.title, show=False) for order in ORDERS),
        Binding("v", "vehicles", "Vehicles"),
        Binding("left_square_bracket", "next_vehicle(-1)", "Previous vehicle", show=False),
        Binding("right_square_bracket", "next_vehicle(1)", "Next vehicle", show=False),
        Binding("ctrl+p", "command_palette", "Commands", priority=True),
        Binding("ctrl+z", "suspend_process", "Suspend", show=False),
        Binding("q", "quit", "Quit"),
        Binding("question_mark", "keys", "Keys"),
        Binding("escape", "hide_keys", "Hide keys", show=False, priority=True),
        Binding("ctrl+c", "quit", "Quit", show=False, priority=True),
    ]

    def __init__(self, feed: Feed, mode: str = SCREENS[0].mode) -> None:
        super().__init__()
        self.feed = feed
        self.plot_fields = PlotFields()
        self.plans = PlanFetcher(feed)
        """The plans of the selected vehicle, for all screens."""
        self.unsaved: dict[str, str] = {}
        """Unsaved changes, by screen, each a sentence."""
        self._first_mode = mode
        self.redraws = 0
        for theme in THEMES:
            self.register_theme(theme)
        self.theme = THEMES[0].name
        self._palette: tuple[str, Palette] | None = None
        self._state: tuple[object, ...] = ()
        self.keys = KeyQueue(self, super().on_event)

    def get_driver_class(self) -> type[Driver]:
        """Return the driver; that for a terminal is our own."""
        chosen = super().get_driver_class()
        return TerminalDriver if issubclass(TerminalDriver, chosen) else chosen

    @property
    def palette(self) -> Palette:
        """Colours of the current theme."""
        if self._palette is None or self._palette[0] != self.theme:
            colours = palette_of(self.theme_variables, self.current_theme.dark)
            if self.no_color:
                colours = monochrome(colours, self.current_theme.dark)
            self._palette = (self.theme, colours)
        return self._palette[1]

    def on_mount(self) -> None:
        """Start the link and the redrawing; end in order if the terminal or the system asks for it."""
        for number in _ENDING_SIGNALS:
            asyncio.get_running_loop().add_signal_handler(number, self.exit)
        self.app_resume_signal.subscribe(self, lambda _app: self.refresh())  # after Ctrl-Z and fg
        self.run_worker(self.keys.run(), group="keys")
        self.feed.start()
        self.switch_mode(self._first_mode)
        self.set_interval(1 / REDRAWS_HZ, self.redraw)

    async def on_event(self, event: Event) -> None:
        """Handle an event; an input of the user waits for the effect of the one before."""
        if isinstance(event, InputEvent | Paste) and not event.is_forwarded:
            self.keys.put(event)
        else:
            await super().on_event(event)

    def on_unmount(self) -> None:
        """End the thread of the link."""
        self.feed.stop()

    def redraw(self) -> None:
        """Draw the newest state on the visible screen, less often below a dialog; end if the link failed."""
        if not self.is_running:  # the screens are being removed
            return
        if self.feed.error is not None:
            self.exit(return_code=1)
            return
        view = self.feed.view
        while self.feed.notices:
            notice = self.feed.notices.popleft()
            self.notify(notice.text, severity=_toast_severity(notice.severity), markup=False)
        targets = [
            (each.identity, each.armed, each.landed_state, each.terminated_for_good)
            for each in self.feed.targets
        ]
        state = (view.identity, targets, len(self.feed.views))
        if state != self._state:  # other keys work
            self._state = state
            self.refresh_bindings()
        screens = self.screen_stack  # empty while a mode begins
        if screens and isinstance(screens[0], WatchScreen) and screens[0].is_composed:
            if len(screens) == 1 or self.redraws % COVERED_EVERY == 0:
                screens[0].show(view, self.feed.now_s)
            self.redraws += 1
        if screens and isinstance(screens[-1], LiveDialog):
            screens[-1].follow()
        for screen in screens:
            if (
                screen.outer_size != self.size
            ):  # Textual's timer for a new size is lost if the process is held up
                screen.post_message(Resize(self.size, self.size))

    # -- what the user asks of the vehicle

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Return False for keys that have no effect now."""
        if action == "order":
            return any(map(order_named(str(parameters[0])).applies, self.feed.targets))
        if action in ("vehicles", "next_vehicle"):
            return len(self.feed.views) > 1
        if action == "hide_keys":
            return self._keys_are_shown
        return True

    @work(exclusive=True, group="quit")
    async def _ask_to_quit(self) -> None:
        if await self.push_screen_wait(
            Confirm("\n".join(self.unsaved.values()) + "\nQuit all the same?", "Quit")
        ):
            self.exit()

    async def action_quit(self) -> None:
        """Quit; ask first if something would be lost. A second Ctrl-C quits."""
        if self.unsaved and not isinstance(self.screen, Confirm):
            self._ask_to_quit()
        else:
            self.exit()

    @work(exclusive=True, group="order")
    async def action_order(self, name: str) -> None:
        """Ask for the values of an order, and for its confirmation if it is dangerous; then perform it."""
        order = order_named(name)
        targets = [view for view in self.feed.targets if order.applies(view)]
        if not targets:
            return
        values: list[Any] | None = []
        if order.fields:
            values = await self.push_screen_wait(OrderForm(order, targets[0]))
        if values is None:
            return
        await self.perform(order.title, targets, partial(action_of, order, values), order.question)

    async def perform(
        self,
        title: str,
        targets: Sequence[VehicleView],
        make: Callable[[VehicleView], Action],
        ask: Callable[[VehicleView], str] = lambda _view: "",
    ) -> None:
        """Ask whether to act on ``targets``, and act on them.

        ``targets`` are the states at the key press: a selection that moves meanwhile does not count.
        ``ask`` returns the question for a vehicle, empty for none.
        """
        total = len(self.feed.views) if self.feed.commands_all else 1
        question = question_for(title, targets, ask, total)
        if question and not await self.push_screen_wait(Confirm(question, title)):
            return
        for view in targets:
            assert view.identity is not None
            self.feed.act(make(view), view.identity.system_id)

    @work(exclusive=True, group="vehicles")
    async def action_vehicles(self) -> None:
        """Select the vehicle to show and to command, or all for commands."""
        chosen = await self.push_screen_wait(VehicleList())
        if chosen is not None:
            self.feed.select(None if chosen == ALL else chosen)

    def action_next_vehicle(self, step: int) -> None:
        """Select the next vehicle by system id."""
        ids = [view.identity.system_id for view in self.feed.views if view.identity is not None]
        current = self.feed.view.identity
        if current is not None and current.system_id in ids:
            self.feed.select(ids[(ids.index(current.system_id) + step) % len(ids)])

    def action_keys(self) -> None:
        """Show or hide the panel of all keys."""
        if self._keys_are_shown:
            self.action_hide_help_panel()
        else:
            self.action_show_help_panel()

    def action_hide_keys(self) -> None:
        """Hide the panel of all keys."""
        self.action_hide_help_panel()

    @property
    def _keys_are_shown(self) -> bool:
        return bool(self.screen.query("HelpPanel"))

    def get_system_commands(self, screen: Screen[Any]) -> Iterable[SystemCommand]:
        """Yield the entries of the command palette."""
        for order in ORDERS:
            if self.check_action("order", (order.name,)):
                yield SystemCommand(
                    order.title, f"{order.help} ({order.key})", partial(self.action_order, order.name)
                )
        for entry in SCREENS:
            yield SystemCommand(
                f"Show {entry.title}", f"{entry.summary} ({entry.key})", partial(self.switch_mode, entry.mode)
            )
        if len(self.feed.views) > 1:
            yield SystemCommand("Vehicles", "Select a vehicle, or all (v)", self.action_vehicles)
        yield from super().get_system_commands(screen)


def _toast_severity(severity: int) -> Literal["information", "warning", "error"]:
    if severity > Severity.WARNING:
        return "information"
    return "warning" if severity == Severity.WARNING else "error"
