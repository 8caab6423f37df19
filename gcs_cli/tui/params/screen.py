"""The screen Parameters: a searchable table, the details of the selected parameter, edits and files."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import ClassVar

from rich.text import Text
from textual import on, work
from textual.app import ComposeResult
from textual.binding import Binding
from textual.containers import Container, Vertical, VerticalScroll
from textual.widgets import Input, Static

from flightstack.core.atomic_file import write_text_atomically
from flightstack.core.enums import Severity
from flightstack.mavlink.param_values import Parameter
from flightstack.params.param_file import is_parameter_name
from gcs_cli.link.connection import Connection
from gcs_cli.transfers import param_calls
from gcs_cli.tui.params.model import (
    ParamList,
    differences_text,
    param_columns,
    param_details,
    param_row,
    parse_param,
)
from gcs_cli.tui.widgets.drawing import LineWidget, watch_app
from gcs_cli.tui.widgets.entry_form import Entry, EntryForm
from gcs_cli.tui.widgets.job_screen import JobScreen, some_of
from gcs_cli.tui.widgets.line_list import SearchField
from gcs_cli.tui.widgets.row_list import RowList, title_text
from gcs_cli.vehicle.param_info import (
    UNKNOWN,
    ParamInfo,
    load_parameters,
    number_text,
    render_parameters,
)
from gcs_cli.vehicle.param_table import change_line
from gcs_cli.vehicle.view_types import VehicleView


class ParamScreen(JobScreen):
    """The parameters are downloaded when the screen is first shown, and again with ``u``."""

    DRAWN: ClassVar = "RowList"
    BINDINGS: ClassVar = [
        Binding("slash", "search", "Search"),
        Binding("c", "changed_only", "Changed only"),
        Binding("enter,e", "edit", "Edit", key_display="⏎"),
        Binding("d", "reset", "Default"),
        Binding("w", "save", "Save"),
        Binding("o", "load", "Load"),
        Binding("f", "compare", "Compare"),
        Binding("u", "update", "Update"),
        Binding("escape", "clear", "Clear", show=False),
    ]

    def __init__(self, mode: str) -> None:
        super().__init__(mode)
        self._params = ParamList()
        self._references: Mapping[str, ParamInfo] = {}
        self._changes = 0
        """Number of parameters that differ from their reference."""
        self.names_shown: list[str] = []
        self._changed_only = False
        self._system_id: int | None = None
        self._problem = ""

    def compose_body(self) -> ComposeResult:
        """Yield the line of state, the table, the details and the search field."""
        yield LineWidget(id="param-state")
        with Container(id="param-body"):
            with Vertical(id="param-table"):
                yield LineWidget(id="param-titles")
                yield RowList(id="param-rows")
            with VerticalScroll(id="param-side", can_focus=False):
                yield Static(id="param-details")
        yield SearchField("letters of the name, or words of the help", id="param-search")

    def on_mount(self) -> None:
        """Put the cursor into the table."""
        self.set_focus(self.rows)

    @property
    def rows(self) -> RowList:
        """The table."""
        return self.query_one(RowList)

    @property
    def selected(self) -> Parameter | None:
        """The parameter under the cursor."""
        return self._params.parameters[self.names_shown[self.rows.cursor]] if self.names_shown else None

    def show(self, view: VehicleView, now_s: float) -> None:
        """Download the parameters of a new vehicle; show the progress."""
        super().show(view, now_s)
        system_id = None if view.identity is None else view.identity.system_id
        if system_id is not None and system_id != self._system_id and not self.is_working:
            self._system_id = system_id
            self._take(ParamList())
            self.action_update()
        self._show_state()

    def recolour(self) -> None:
        """Draw titles and details again; the rows follow the theme themselves."""
        self._show_titles()
        self._show_details()

    def check_action(self, action: str, parameters: tuple[object, ...]) -> bool | None:
        """Return False for keys that have no effect now."""
        if action in ("changed_only", "edit", "reset", "save", "load", "compare"):
            return bool(self._params.parameters)
        return True

    def _show_state(self) -> None:
        colours, params = watch_app(self).palette, self._params
        left = Text(no_wrap=True, end="")
        if self.doing:
            left.append(self.doing_text, colours.accent)
        elif not params.parameters:
            left.append(self._problem or "waiting for a vehicle", colours.warning)
        else:
            left.append(f"{len(self.names_shown)} of {len(params.parameters)} parameters", colours.text)
            query = self.query_one(SearchField).value
            left.append(f", with “{query}”" if query else "", colours.text)
            left.append(", changed only" if self._changed_only else "", colours.warning)
        self.show_line("param-state", left, Text(self._changes_text(), colours.warning))

    def _changes_text(self) -> str:
        params = self._params
        if params.file is None:
            return f"{self._changes} not at the default" if self._changes else ""
        return f"{self._changes or 'none'} other than in {params.file_name}"

    # -- the table

    def _take(self, params: ParamList) -> None:
        """Show new parameters; the cursor stays at its parameter."""
        self._params, self._references, self._changes = params, params.references, len(params.changed())
        self._filter()
        self.refresh_bindings()

    def _filter(self, *, keeps: bool = True) -> None:
        rows = self.rows
        before = self.names_shown[rows.cursor] if self.names_shown and keeps else ""
        self.names_shown = self._params.names(self.query_one(SearchField).value, self._changed_only)
        rows.show_rows(len(self.names_shown), self._draw)
        rows.select(self.names_shown.index(before) if before in self.names_shown else 0)
        self._show_titles()
        self._show_details()
        self._show_state()

    def _compared(self) -> str:
        return "default" if self._params.file is None else "file"

    def _draw(self, index: int, width: int) -> Text:
        name = self.names_shown[index]
        info, reference = self._params.infos.get(name, UNKNOWN), self._references.get(name, UNKNOWN)
        columns = param_columns(width, self._compared())
        return param_row(self._params.parameters[name], info, reference, columns, watch_app(self).palette)

    def _show_titles(self) -> None:
        columns = param_columns(self.rows.size.width, self._compared())
        titles = title_text(columns, watch_app(self).palette.muted)
        self.query_one("#param-titles", LineWidget).show_line(titles)

    def _show_details(self) -> None:
        parameter, details = self.selected, Text()
        if parameter is not None:
            info = self._params.infos.get(parameter.name, UNKNOWN)
            in_file = (self._params.file or {}).get(parameter.name)
            details = param_details(parameter, info, in_file, watch_app(self).palette)
        self.query_one("#param-details", Static).update(details)
        self.query_one("#param-side").scroll_home(animate=False)

    def on_resize(self) -> None:
        """Draw the titles in the new width."""
        self.call_after_refresh(self._show_titles)

    @on(RowList.Selected)
    def _selected(self) -> None:
        self._show_details()

    @on(RowList.Chosen)
    def _chosen(self) -> None:
        self.action_edit()

    # -- search and filters

    def action_search(self) -> None:
        """Open the search field."""
        self.query_one(SearchField).open()

    def action_changed_only(self) -> None:
        """Show all parameters, or those that differ."""
        self._changed_only = not self._changed_only
        self._filter()

    def action_clear(self) -> None:
        """Close the search field; without one, end the comparison with a file."""
        search = self.query_one(SearchField)
        self.set_focus(self.rows)
        if search.display:
            search.close()
        elif self._params.file is not None or self._changed_only:
            self._changed_only = False
            self._take(self._params._replace(file=None, file_name=""))

    @on(Input.Changed, "#param-search")
    def _searched(self) -> None:
        self._filter(keeps=False)

    @on(Input.Submitted, "#param-search")
    def _found(self) -> None:
        self.set_focus(self.rows)

    # -- exchange with the vehicle

    @work
    async def action_update(self) -> None:
        """Download all parameters and their metadata."""
        found = await self.run_job("downloading the parameters", self._download, self._system_id)
        if found is None:
            self._problem = "no parameters: update with u"
        else:
            parameters, infos = found
            by_name = {parameter.name: parameter for parameter in parameters}
            self._take(self._params._replace(parameters=by_name, infos=infos))

    def _download(self, connection: Connection) -> tuple[tuple[Parameter, ...], dict[str, ParamInfo]]:
        parameters = param_calls.fetch_all(connection, self.show_progress)
        return parameters, param_calls.fetch_metadata(connection)

    @work
    async def action_edit(self) -> None:
        """Ask for a value, send it, and show the one that the vehicle confirms."""
        parameter, system_id = self.selected, self._system_id
        if parameter is None:
            return
        info = self._params.infos.get(parameter.name, UNKNOWN)
        title = f"{parameter.name}: {info.help}" if info.help else parameter.name
        label = f"{info.unit or 'value'} ({info.range_text})" if info.range_text else info.unit or "value"
        entry = Entry(label, number_text(parameter.value), [text for _, text in info.choices])
        form = EntryForm(title, [entry], lambda texts: parse_param(parameter, info, texts[0]))
        value = await self.app.push_screen_wait(form)
        if value is not None:
            await self._set(parameter, info, value, system_id)

    @work
    async def action_reset(self) -> None:
        """Set the selected parameter to its default."""
        parameter, system_id = self.selected, self._system_id
        if parameter is None:
            return
        info = self._params.infos.get(parameter.name, UNKNOWN)
        if info.default is None:
            self.notify(f"{parameter.name}: the vehicle does not send its default", severity="warning")
            return
        default = number_text(info.default)
        if await self.ask(f"Reset {parameter.name} = {number_text(parameter.value)} to {default}?", "Reset"):
            await self._set(parameter, info, info.default, system_id)

    async def _set(self, parameter: Parameter, info: ParamInfo, value: float, system_id: int | None) -> None:
        name = parameter.name
        job = partial(param_calls.change, name=name, value=value)
        after = await self.run_job(f"setting {name}", job, system_id)
        if after is not None:
            self._take(self._params.with_parameter(after))
            watch_app(self).feed.tell(change_line(name, parameter.value, after.value, info))

    # -- files

    @work
    async def action_save(self) -> None:
        """Write all parameters to a file."""
        identity = watch_app(self).feed.view.identity
        if identity is None:
            return
        path = await self.ask_file("Save all parameters", "vehicle.params", (), is_new=True)
        if path is None:
            return
        saved = [each for each in self._params.parameters.values() if is_parameter_name(each.name)]
        text = render_parameters(saved, identity.system_id, identity.component_id)
        self.attempt(partial(self._write, path, text, len(saved)))

    def _write(self, path: Path, text: str, count: int) -> None:
        write_text_atomically(path, text)
        watch_app(self).feed.tell(f"{count} parameters saved to {path}")

    async def _read(self, title: str) -> tuple[Path, dict[str, float]] | None:
        path = await self.ask_file(title, "", (), is_new=False)
        wanted = None if path is None else self.attempt(partial(load_parameters, path))
        return None if path is None or wanted is None else (path, wanted)

    @work
    async def action_compare(self) -> None:
        """Show the parameters that differ from a file."""
        read = await self._read("Compare with a parameter file")
        if read is None:
            return
        path, wanted = read
        self._changed_only = True
        self._take(self._params._replace(file=wanted, file_name=path.name))
        missing = sorted(set(wanted) - set(self._params.parameters))
        if missing:
            self.notify(f"not known to the vehicle: {some_of(missing)}", severity="warning")

    @work
    async def action_load(self) -> None:
        """Set the parameters that differ from a file, after a question with the differences."""
        system_id = self._system_id
        read = await self._read("Load a parameter file")
        if read is None:
            return
        path, wanted = read
        lines = differences_text(self._params, wanted)
        if not lines:
            self.notify(f"all {len(wanted)} parameters are as in {path}")
        elif await self.ask(f"{some_of(lines)}\n\nSet them as in {path.name}?", "Set"):
            present = dict(self._params.parameters)
            job = partial(param_calls.change_all, wanted=wanted, present=present, show=self.show_progress)
            result = await self.run_job(f"loading {path.name}", job, system_id)
            if result is not None:
                self._say_loaded(path, result, len(wanted))

    def _say_loaded(self, path: Path, result: param_calls.Changes, count: int) -> None:
        feed = watch_app(self).feed
        for parameter in result.changed:
            self._params = self._params.with_parameter(parameter)
        self._take(self._params)
        for failure in result.failures:
            feed.tell(failure, Severity.ERROR)
        feed.tell(f"{len(result.changed)} of {count} parameters of {path.name} changed")
