"""The plans on the vehicle, downloaded again when the vehicle reports other ones."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Any, Protocol, TypeVar

from flightstack.plan import PLAN_NAMES, MissionItem, MissionType, Plan
from gcs_cli.errors import CliError
from gcs_cli.link import calls
from gcs_cli.link.connection import Connection
from gcs_cli.vehicle.view_types import VehicleView

Result = TypeVar("Result")
_ID_FIELDS = {
    MissionType.MISSION: "mission_id",
    MissionType.FENCE: "fence_id",
    MissionType.RALLY: "rally_points_id",
}
"""Fields of MISSION_CURRENT that change with each plan; 0 if the vehicle has no ids."""


class Jobs(Protocol):
    """Runs functions in the thread of the link."""

    def submit(self, job: Callable[[Connection], Result], system_id: int | None) -> Future[Result]:
        """Run ``job`` on this vehicle and return its future result."""


class PlanFetcher:
    """Downloads mission, geofence and rally points one after the other; ``update`` never waits."""

    def __init__(self, jobs: Jobs) -> None:
        self._jobs = jobs
        self._seen: dict[MissionType, object] = {}
        self._items: dict[MissionType, tuple[MissionItem, ...]] = {}
        self._loading: tuple[MissionType, Future[tuple[MissionItem, ...]]] | None = None
        self.system_id: int | None = None
        """The vehicle of ``plan``."""
        self._problems: dict[MissionType, str] = {}
        self.plan = Plan(())
        """The plans that were downloaded; the same object until one changes."""

    @property
    def problem(self) -> str:
        """Reasons of the downloads that failed, or an empty text."""
        return "; ".join(self._problems.values())

    @property
    def loading(self) -> str:
        """Name of the plan that is being downloaded, or an empty text."""
        return "" if self._loading is None else PLAN_NAMES[self._loading[0]]

    @property
    def has_mission(self) -> bool:
        """True if the mission of the vehicle has been downloaded; it may have no items."""
        return MissionType.MISSION in self._items

    def reload(self) -> None:
        """Download all plans again."""
        self._seen.clear()

    def update(self, view: VehicleView, mission_current: Any | None) -> None:
        """Begin the next download and take the result of the last one.

        ``mission_current`` is the vehicle's last MISSION_CURRENT, whose ids and total change with the plans.
        """
        if self._loading is not None:
            self._take(*self._loading)
        if view.identity is None or self._loading is not None:
            return
        if view.identity.system_id != self.system_id:
            self.system_id = view.identity.system_id
            self._seen.clear()
            self._items.clear()
            self._problems.clear()
            self.plan = Plan(())
        for kind, field in _ID_FIELDS.items():
            state = (getattr(mission_current, field, 0), kind == MissionType.MISSION and view.mission.total)
            if self._seen.get(kind) != state:
                self._seen[kind] = state
                self._loading = (kind, self._jobs.submit(partial(_download, kind=kind), self.system_id))
                return

    def _take(self, kind: MissionType, future: Future[tuple[MissionItem, ...]]) -> None:
        if not future.done():
            return
        self._loading = None
        if future.cancelled():
            return
        error = future.exception()
        if error is None:
            self._problems.pop(kind, None)
            former, self._items[kind] = self._items.get(kind, ()), future.result()
            if self._items[kind] != former:
                mission, fence, rally = (self._items.get(each, ()) for each in _ID_FIELDS)
                self.plan = Plan(mission, fence=fence, rally=rally)
        elif isinstance(error, CliError):
            self._problems[kind] = str(error)
        else:
            raise error


def _download(connection: Connection, kind: MissionType) -> tuple[MissionItem, ...]:
    if connection.is_recording:
        return ()
    call = calls.download(connection.session, kind)
    return connection.complete(call, f"download of the {PLAN_NAMES[kind]}", may_lack=True).items
