"""Downloads of the plans of a vehicle for the screens."""

from __future__ import annotations

from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import pytest

from flightstack.plan import FenceCommand, MissionItem
from gcs_cli.errors import FAILED, CliError
from gcs_cli.tui.mission.plan_fetcher import PlanFetcher
from gcs_cli.vehicle.view_types import Identity, Mission, VehicleView

pytestmark = pytest.mark.unit

VIEW = VehicleView(identity=Identity(1, 1, 2, 12), mission=Mission(0, 2))
ITEM = MissionItem(16, 6, x=1, y=2)
VERTEX = MissionItem(FenceCommand.CIRCLE_INCLUSION, 6, param1=9.0)


class Jobs:
    def __init__(self) -> None:
        self.futures: list[Future[Any]] = []

    def submit(self, _job: Any, _system_id: int | None) -> Future[Any]:
        self.futures.append(Future())
        return self.futures[-1]


def ids(mission: int = 7, fence: int = 0, rally: int = 0) -> SimpleNamespace:
    return SimpleNamespace(mission_id=mission, fence_id=fence, rally_points_id=rally)


def fetched(view: VehicleView = VIEW, state: Any = None) -> tuple[Jobs, PlanFetcher]:
    jobs = Jobs()
    fetcher = PlanFetcher(jobs)
    for items in ((ITEM,), (VERTEX,), ()):
        fetcher.update(view, state or ids())
        jobs.futures[-1].set_result(items)
    fetcher.update(view, state or ids())
    return jobs, fetcher


def test_three_plans_are_downloaded_one_after_the_other():
    jobs = Jobs()
    fetcher = PlanFetcher(jobs)
    for _ in range(3):
        fetcher.update(VIEW, ids())
    assert len(jobs.futures) == 1
    assert fetcher.loading == "mission"
    jobs, fetcher = fetched()
    assert (fetcher.plan.items, fetcher.plan.fence, fetcher.plan.rally) == ((ITEM,), (VERTEX,), ())
    assert (len(jobs.futures), fetcher.loading) == (3, "")


def test_nothing_is_downloaded_without_a_vehicle():
    jobs = Jobs()
    PlanFetcher(jobs).update(VehicleView(), None)
    assert not jobs.futures


@pytest.mark.parametrize(
    ("view", "state", "loading"),
    [
        (VIEW, ids(mission=8), "mission"),
        (VIEW._replace(mission=Mission(0, 3)), ids(), "mission"),
        (VIEW, ids(fence=1), "geofence"),
        (VIEW, ids(rally=1), "list of rally points"),
        (VIEW._replace(mission=Mission(1, 2)), ids(), ""),
    ],
)
def test_only_the_plan_that_changed_is_downloaded_again(view, state, loading):
    _, fetcher = fetched()
    before = fetcher.plan
    fetcher.update(view, state)
    assert fetcher.loading == loading
    assert fetcher.plan is before


def test_reload_downloads_all_plans_and_keeps_equal_ones():
    jobs, fetcher = fetched()
    before = fetcher.plan
    fetcher.reload()
    for items in ((ITEM,), (VERTEX,), ()):
        fetcher.update(VIEW, ids())
        jobs.futures[-1].set_result(items)
    fetcher.update(VIEW, ids())
    assert len(jobs.futures) == 6
    assert fetcher.plan is before


def test_another_vehicle_has_plans_of_its_own():
    _, fetcher = fetched()
    fetcher.update(VIEW._replace(identity=Identity(2, 1, 2, 12)), ids())
    assert (fetcher.plan.items, fetcher.loading) == ((), "mission")


def test_failed_download_is_named_and_tried_again_on_request():
    jobs = Jobs()
    fetcher = PlanFetcher(jobs)
    fetcher.update(VIEW, ids())
    jobs.futures[0].set_exception(CliError("download of the mission: no answer", FAILED))
    for _ in range(4):
        fetcher.update(VIEW, ids())
        if fetcher.loading:
            jobs.futures[-1].set_result(())
    assert len(jobs.futures) == 3
    assert fetcher.problem == "download of the mission: no answer"
    fetcher.reload()
    fetcher.update(VIEW, ids())
    assert fetcher.loading == "mission"
