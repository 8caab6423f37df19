"""The screen Mission: the items with their progress, edits, files, upload and control of the flight."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import ClassVar, NamedTuple

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Vertical

from flightstack.core.enums import Severity
from flightstack.core.geodesy import GeoPoint
from flightstack.plan import PLAN_NAMES, MissionItem, MissionType, Plan
from gcs_cli.actions import in_flight, in_mission
from gcs_cli.actions.action import Action
from gcs_cli.link.connection import Connection
from gcs_cli.plans import edit
from gcs_cli.plans.formats.files import SUFFIXES, load_any, save_any
from gcs_cli.plans.names import any_command_name
from gcs_cli.transfers import plan_transfers
from gcs_cli.transfers.plan_parts import Uploads, parts_to_send
from gcs_cli.transfers.vehicle_plans import problems_on_vehicle
from gcs_cli.tui.mission.draft import MissionDraft
from gcs_cli.tui.mission.item_form import item_entries, item_of_texts, new_item
from gcs_cli.tui.mission.rows import (
    MissionTable,
    Progress,
    mission_columns,
    mission_progress,
    mission_row,
    mission_table,
    summary,
)
from gcs_cli.tui.orders.orders import asks_to_start, goes_on, in_air, takes_orders, vehicle_name
from gcs_cli.tui.widgets.drawing import LineWidget, watch_app
from gcs_cli.tui.widgets.entry_form import EntryForm
from gcs_cli.tui.widgets.job_screen import JobScreen, some_of
from gcs_cli.tui.widgets.row_list import RowList, title_text
from gcs_cli.vehicle.view_types import VehicleView

_ALTITUDE_M = 5.0


class Comparison(NamedTuple):
    """Result of the comparison of a plan with the vehicle's."""

    sentence: str
    is_equal: bool


class MissionScreen(JobScreen):
    """The list follows the vehicle's mission until it is edited; then it stays until it is uploaded or dropped."""

    DRAWN: ClassVar = "RowList"
    BINDINGS: ClassVar = [
        Binding("enter,e", "edit", "Edit", key_display="⏎"),
        Binding("a", "add", "Add"),
        Binding("d,delete", "delete", "Delete", key_display="d"),
        Binding("z", "undo", "Undo"),
        Binding("u", "upload", "Upload"),
        Binding("j", "jump", "Jump"),
        Binding("p", "pause", "Pause"),
        Binding("s", "start", "Start"),
        Binding("o", "load", "Load"),
        Binding("w", "save", "Save"),
        Binding("K,shift+up", "shift(-1)", "Move", key_display="J K"),
        Binding("J,shift+down", "shift(1)", "Move down", show=False),
        Binding("c", "verify", "Verify"),
        Binding("g", "download", "Download"),
    ]

    def __init__(self, mode: str) -> None:
        super().__init__(mode)
        self.draft = MissionDraft()
        self._table = mission_table(Plan(()), None)
        self._shown: object = None
        self._keys: object = None
        self._progress = Progress()

    def compose_body(self) -> ComposeResult:
        """Yield the line of state and the table."""
        yield LineWidget(id="mission-state")
        with Vertical(id="mission-table"):
            yield LineWidget(id="mission-titles")
            yield RowList(id="mission-rows")

    def on_mount(self) -> None:
        """Put the cursor into the table."""
        self.set_focus(self.rows)

    @property
    def rows(self) -> RowList:
        """The table."""
        return self.query_one(RowList)

    @property
    def items(self) -> edit.Items:
        """The items of the edited mission."""
        return self.draft.plan.items

    def show(self, view: VehicleView, now_s: float) -> None:
        """Download the plans if they changed on the vehicle; draw the list and the progress."""
        super().show(view, now_s)
        app = watch_app(self)
        system_id = None if view.identity is None else view.identity.system_id
        streams = app.feed.history.streams(system_id)
        current = [stream.last for stream in streams if stream.name == "MISSION_CURRENT"]
        if not self.is_working:
            app.plans.update(view, current[0] if current else None)
        if not app.plans.loading:
            self.draft = self.draft.followed(app.plans.plan, app.plans.system_id)
        self._redraw()

    def _redraw(self) -> None:
        """Draw what changed."""
        app = watch_app(self)
        view = app.feed.view
        home = None if view.home is None else GeoPoint(*view.home[:3])
        if self._table.items is not self.items or (home is not None and self._table.home != home):
            self._table = mission_table(self.draft.plan, home)
        table = self._table
        self._progress = Progress() if self.draft.is_changed else mission_progress(table, view)
        keys = (bool(self.items), bool(self.draft.past), self.draft.is_changed, view.armed, goes_on(view))
        if keys != self._keys:
            self._keys = keys
            self.refresh_bindings()
        shown = (table.items, table.home, self._progress, self.rows.size, app.theme)
        if shown != self._shown:
            self._shown = shown
            in_flight = self._progress.left_m is not None
            self._draw_table(table, self._progress, in_flight=in_flight)
        self._show_state()
        if self.draft.is_changed:
            app.unsaved[self.mode] = "The edited mission is not uploaded."
        else:
            app.unsaved.pop(self.mode, None)

    def _draw_table(self, table: MissionTable, progress: Progress, *, in_flight: bool) -> None:
        colours = watch_app(self).palette
        columns = mission_columns(self.rows.size.width, in_flight=in_flight)
        self.query_one("#mission-titles", LineWidget).show_line(title_text(columns, colours.muted))

        def draw(seq: int, _width: int) -> Text:
            return mission_row(table, seq, progress, columns, colours)

        self.rows.show_rows(len(table.items), draw)

    def _show_state(self) -> None:
        app = watch_app(self)
        colours, plans, draft = app.palette, app.plans, self.draft
        left = Text(no_wrap=True, end="")
        if draft.is_changed:
            left.append(" NOT UPLOADED ", f"bold {colours.background} on {colours.warning}")
            left.append(" ")
        if plans.has_mission or self.items or draft.is_changed:
            left.append(summary(self._table, self._progress), colours.text)
        elif plans.loading != PLAN_NAMES[MissionType.MISSION]:
            left.append("mission unknown", colours.text)
        parts = [f"fence: {len(draft.plan.fence)}"] if draft.plan.fence else []
        parts += [f"rally points: {len(draft.plan.rally)}"] if draft.plan.rally else []
        right = Text(", ".join(parts), colours.muted)
        if self.doing:
            right = Text(self.doing_text, colours.accent)
        elif plans.problem:
            right = Text(plans.problem, colours.bad)
        elif plans.loading:
            right = Text(f"downloading the {plans.loading}", colours.accent)
        self.show_line("mission-state", left, right)

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Return False for keys that have no effect now."""
        if action in ("edit", "delete", "shift", "verify", "save"):
            return bool(self.items)
        if action == "undo":
            return bool(self.draft.past)
        if action == "jump":
            return bool(self.items) and not self.draft.is_changed
        if action == "pause":
            return takes_orders(watch_app(self).feed.view)
        if action == "start":
            return goes_on(watch_app(self).feed.view)
        return True

    # -- edits

    def _edit(self, items: edit.Items, seq: int) -> None:
        self.draft = self.draft.edited(items)
        self._redraw()
        self.rows.select(seq)

    async def _ask_item(self, title: str, item: MissionItem, first: int = 0) -> MissionItem | None:
        form = EntryForm(title, item_entries(item), partial(item_of_texts, item), first)
        changed: MissionItem | None = await self.app.push_screen_wait(form)
        return changed

    @on(RowList.Chosen)
    def _chosen(self) -> None:
        self.action_edit()

    @work
    async def action_edit(self) -> None:
        """Change the fields of the selected item."""
        seq, items = self.rows.cursor, self.items
        if not items:
            return
        item = await self._ask_item(f"Item {seq}", items[seq])
        if item is not None and item != items[seq]:
            self._edit((*items[:seq], item, *items[seq + 1 :]), seq)

    @work
    async def action_add(self) -> None:
        """Add an item after the selected one."""
        items = self.items
        seq = min(self.rows.cursor + 1, len(items))
        before = [item for item in items[:seq] if item.position_deg is not None]
        geo = watch_app(self).feed.view.geo
        place = before[-1].position_deg if before else None if geo is None else geo[:2]
        altitude_m = before[-1].z if before else _ALTITUDE_M
        item = await self._ask_item(f"New item {seq}", new_item(place, altitude_m))
        if item is not None:
            self._edit(edit.add(items, seq, item), seq)

    def action_delete(self) -> None:
        """Delete the selected item."""
        if self.items:
            seq = self.rows.cursor
            self._edit(edit.delete(self.items, seq), seq)

    def action_shift(self, step: int) -> None:
        """Move the selected item up or down."""
        seq = self.rows.cursor
        if self.items and 0 <= seq + step < len(self.items):
            self._edit(edit.move(self.items, seq, seq + step), seq + step)

    def action_undo(self) -> None:
        """Undo the last edit."""
        self.draft = self.draft.undone()
        self._redraw()

    # -- files

    async def _may_drop(self) -> bool:
        return not self.draft.is_changed or await self.ask("Drop the edits that are not uploaded?", "Drop")

    @work
    async def action_load(self) -> None:
        """Edit the plan of a file."""
        if not await self._may_drop():
            return
        path = await self.ask_file("Load a plan", "", SUFFIXES, is_new=False)
        plan = None if path is None else self.attempt(partial(load_any, path))
        if path is not None and plan is not None:
            self.draft = self.draft.loaded(plan)
            self._redraw()
            self.rows.select(0)
            watch_app(self).feed.tell(f"{len(plan.items)} items loaded from {path}: u uploads them")

    @work
    async def action_save(self) -> None:
        """Write the plan to a file, in the format of its suffix."""
        path = await self.ask_file("Save the plan", "mission.plan", SUFFIXES, is_new=True)
        lost = None if path is None else self.attempt(partial(save_any, path, self.draft.plan))
        if lost is not None:
            what = f"{len(self.items)} items saved to {path}"
            severity = Severity.WARNING if lost else Severity.NOTICE
            watch_app(self).feed.tell(f"{what}; lost: {lost}" if lost else what, severity)

    # -- exchange with the vehicle

    @work
    async def action_upload(self) -> None:
        """Check the plan, upload it, and compare the vehicle's with it."""
        plan, draft, system_id = self.draft.to_upload(), self.draft, self._selected_id
        if draft.is_changed and draft.system_id not in (None, system_id):
            question = f"The plan of vehicle {draft.system_id} was edited. Upload it to vehicle {system_id}?"
            if not await self.ask(question, "Upload"):
                return
        checked = await self.run_job("checking", partial(problems_on_vehicle, plan=plan), system_id)
        if checked is None:
            return
        problems, unchecked = checked
        if unchecked:
            watch_app(self).feed.tell(unchecked)
        if problems:
            lines = some_of([f"{problem.part}: {problem.reason}" for problem in problems])
            if not await self.ask(f"The vehicle would refuse the plan:\n{lines}\n\nUpload it?", "Upload"):
                return
        view = watch_app(self).feed.view
        if view.armed and not await self.ask("The vehicle is armed. Replace its mission?", "Replace"):
            return
        uploaded = await self.run_job(
            "uploading", partial(self._upload, plan=plan), system_id, ends_in_order=True
        )
        if uploaded is None:
            return
        edited = self.draft
        sent = self.draft = edited.uploaded(system_id) if edited.to_upload() == plan else edited
        watch_app(self).plans.reload()
        self._redraw()
        found = await self._read_back(plan, system_id, "uploaded")
        if found is not None and not found.is_equal and self.draft is sent:
            self.draft = edited
            self._redraw()

    async def _read_back(self, plan: Plan, system_id: int | None, done: str) -> Comparison | None:
        """Compare ``plan`` with the vehicle's and show the result after ``done``; None if it is unknown."""
        job = partial(self._compare, plan=plan)
        found = await self.run_job("reading back", job, system_id, failure=f"{done}, not compared")
        if found is not None:
            severity = Severity.NOTICE if found.is_equal else Severity.ERROR
            watch_app(self).feed.tell(f"{done}: {found.sentence}", severity)
        return found

    @property
    def _selected_id(self) -> int | None:
        identity = watch_app(self).feed.view.identity
        return None if identity is None else identity.system_id

    def _upload(self, connection: Connection, plan: Plan) -> bool:
        uploads = Uploads(connection.session, plan, restores=True, interrupted=lambda: self._note(uploads))
        plan_transfers.complete_upload(connection, uploads, "the edited plan")
        return True

    def _note(self, uploads: Uploads) -> str:
        self.progress = uploads.progress
        return "interrupted" if watch_app(self).feed.is_stopping else ""

    def _compare(self, connection: Connection, plan: Plan) -> Comparison:
        """Return the differences of the vehicle's plan, or the parts that are equal."""
        compared = plan_transfers.compare_with_vehicle(connection, parts_to_send(plan))
        lines: dict[bool, list[str]] = {False: [], True: []}
        for part, found in compared:
            for difference in found:
                lines[difference.cannot_be_held].append(f"{part.name}: {difference.sentence}")
        if lines[False]:
            return Comparison(f"the vehicle's plan differs: {some_of(lines[False])}", is_equal=False)
        equal = ", ".join(
            f"{part.name} of {len(part.items)} items {plan_transfers.equality(found)}"
            for part, found in compared
        )
        return Comparison("\n".join(filter(None, [equal, some_of(lines[True])])), is_equal=True)

    @work
    async def action_verify(self) -> None:
        """Compare the vehicle's plan with the list."""
        await self._read_back(self.draft.to_upload(), self._selected_id, "verified")

    @work
    async def action_download(self) -> None:
        """Show the vehicle's plan; drop the edits."""
        if await self._may_drop():
            self.draft = MissionDraft()
            watch_app(self).plans.reload()

    @work
    async def action_jump(self) -> None:
        """Make the selected item the current one."""
        seq = self.rows.cursor
        name = any_command_name(self.items[seq].command)
        await self._perform(
            "Jump",
            lambda _view: in_mission.jump(seq),
            lambda view: f"Fly {vehicle_name(view)} to item {seq} ({name})?" if view.armed else "",
        )

    @work
    async def action_pause(self) -> None:
        """Hold the position."""
        await self._perform("Pause", lambda _view: in_mission.pause())

    @work
    async def action_start(self) -> None:
        """Start the mission on the ground, or resume it in the air."""
        await self._perform(
            "Start",
            lambda view: in_mission.resume() if in_air(view) else in_flight.start_mission(),
            asks_to_start,
        )

    async def _perform(
        self,
        title: str,
        make: Callable[[VehicleView], Action],
        ask: Callable[[VehicleView], str] = lambda _view: "",
    ) -> None:
        app = watch_app(self)
        await app.perform(title, app.feed.targets, make, ask)
