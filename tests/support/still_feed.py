"""A feed without a link: the screens of ``gcs watch`` show what a test puts into it."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from flightstack.core.enums import Severity
from gcs_cli.actions.action import Action
from gcs_cli.link.connection import Connection
from gcs_cli.tui.feed import Feed, Notice
from gcs_cli.tui.fly.history import History
from gcs_cli.tui.map.traffic import Traffic
from gcs_cli.tui.messages.message_log import MessageLog
from gcs_cli.vehicle.view_types import VehicleView


class StillFeed(Feed):
    def __init__(self, view: VehicleView, now_s: float = 10.0, history: History | None = None) -> None:
        self.history = history or History()
        self.traffic = Traffic()
        self.messages = MessageLog()
        self.messages.follow(view)
        self.notices = deque()
        self.actions: list[Action] = []
        """Actions that the user asked for."""
        self.acted_on: list[int] = []
        """System ids of the vehicles of ``actions``."""
        self.commands_all = False
        self.others: list[VehicleView] = []
        self.error = None
        self._is_stopping = False
        self.rates_hz = {}
        self.shown = view
        self.time_s = now_s
        self.jobs: list[tuple[Callable[[Connection], Any], Future[Any]]] = []
        """Jobs that screens have submitted; a test sets their results."""
        self.job_targets: list[int | None] = []
        """System ids of the vehicles of ``jobs``."""

    @property
    def view(self) -> VehicleView:
        return self.shown

    @property
    def views(self) -> tuple[VehicleView, ...]:
        return (self.shown, *self.others) if self.shown.identity is not None else ()

    def select(self, system_id: int | None) -> None:
        self.commands_all = system_id is None
        self.shown = next((view for view in self.views if view.identity.system_id == system_id), self.shown)

    @property
    def now_s(self) -> float:
        return self.time_s

    @property
    def link_name(self) -> str:
        return "UDP 127.0.0.1:14550"

    def submit(
        self, job: Callable[[Connection], Any], system_id: int | None = None, *, ends_in_order: bool = False
    ) -> Future[Any]:
        self.job_targets.append(system_id)
        self.jobs.append((job, Future()))
        return self.jobs[-1][1]

    def act(self, action: Action, system_id: int) -> None:
        self.actions.append(action)
        self.acted_on.append(system_id)

    def tell(self, text: str, severity: Severity = Severity.NOTICE) -> None:
        self.notices.append(Notice(text, severity))
        self.messages.say(self.shown, text, severity)

    def start(self) -> None:
        """Nothing runs."""

    def stop(self) -> None:
        """Nothing runs."""
