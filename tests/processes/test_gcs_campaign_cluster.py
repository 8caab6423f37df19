"""``gcs campaign --scheduler`` with real Dask schedulers and workers: equal tables, losses, other versions, Ctrl-C."""

from __future__ import annotations

import json
import socket
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from flightstack.plan import Command
from flightstack.plan.files import load_plan, save_plan
from tests.support.commands import gcs
from tests.support.dask_cluster import Cluster
from tests.support.process import Process, children_of, ends_of, wait_until
from tests.support.warm_children import warm_children

ROOT = Path(__file__).resolve().parents[2]
CAMPAIGN = """\
plan = "{plan}"
vehicle = "../vehicles/v.toml"
state = "truth"
[campaign]
method = "latin-hypercube"
flights = 4
[vary]
wind.gust_m_s = {{ uniform = [0, 2] }}
simulated.body.mass_kg = {{ uniform = [1.3, 1.7] }}
[expect]
max_error_m = 0.6
"""
ENDLESS = """\
vehicle = "x_quad"
state = "truth"
duration_s = 100000
[campaign]
flights = 3
[vary]
wind.gust_m_s = { uniform = [0, 2] }
[expect]
"""
FETCHED_LATE = """\
import asyncio
import contextlib

def dask_setup(scheduler):
    gather = scheduler.handlers["gather"]

    async def gather_without_worker(*arguments, **keywords):
        scheduler.handlers["gather"] = gather
        print("a result is fetched", flush=True)
        while scheduler.workers:
            await asyncio.sleep(0.01)
        return await gather(*arguments, **keywords)

    scheduler.handlers["gather"] = gather_without_worker
"""
"""Makes the fetch of the first result wait for the loss of the worker that has it."""
FLIES = "gcs_cli.scenarios.worker"
TABLES = ("flights.parquet", "flights.csv")
HELD_S = 900.0
"""Of a flight, which takes a second of processor time: a worker that is killed after the first one flies another."""


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with a campaign, its plan and vehicle, and its results without a cluster in ``local``."""
    top = tmp_path_factory.mktemp("campaign")
    here, vehicles = top / "here", top / "vehicles"
    here.mkdir()
    vehicles.mkdir()
    (vehicles / "v.toml").write_bytes((ROOT / "flightstack/params/vehicles/x_quad.toml").read_bytes())
    plan = here / "p.plan"
    hop = load_plan(ROOT / "missions/hop.plan")
    takeoff, landing = hop.items
    held = replace(takeoff, command=Command.NAV_LOITER_TIME, param1=HELD_S)
    save_plan(plan, replace(hop, items=(takeoff, held, landing)))
    (here / "c.toml").write_text(CAMPAIGN.format(plan=plan))
    with pytest.MonkeyPatch.context() as patch, warm_children():
        patch.chdir(here)
        assert gcs("campaign", "c.toml", "-j", 1, "--out", "local", "--csv").returncode == 0
    return here


@pytest.fixture(scope="module")
def cluster(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Cluster]:
    with Cluster(tmp_path_factory.mktemp("cluster")) as cluster:
        yield cluster


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.toml").write_text(ENDLESS)
    return tmp_path


def campaign(cluster: Cluster, *arguments: str) -> Process:
    return Process("gcs_cli", "campaign", "c.toml", "--scheduler", cluster.address, *arguments)


def tables(folder: str) -> dict[str, bytes]:
    return {name: Path(folder, name).read_bytes() for name in TABLES}


def flights(run: Process) -> list[dict[str, Any]]:
    found = [json.loads(line) for line in run.lines if line.startswith("{")]
    return [event for event in found if event["event"] == "flight"]


def test_flights_of_a_killed_worker_fly_on_an_added_one_to_the_same_table(
    flown: Path, cluster: Cluster, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(flown)
    first = cluster.add_worker()
    first.wait_for("Registered to")  # else the notice of a cluster without workers may come before
    run = campaign(cluster, "--out", "cluster", "--csv", "--json")
    run.wait_for('"event": "flight"')
    first.kill()
    run.wait_for(f"{cluster.address} has no workers: the flights wait for one")
    second = cluster.add_worker()
    assert run.end() == 0
    second.kill()
    assert sorted(event["flight"] for event in flights(run)) == [1, 2, 3, 4]
    assert tables("cluster") == tables("local")


def lose_first_result(cluster: Cluster, *arguments: str) -> Process:
    """Return a campaign whose only worker is lost between the end of a flight and the fetch of its result."""
    worker = cluster.add_worker()
    worker.wait_for("Registered to")
    run = campaign(cluster, *arguments)
    cluster.scheduler.wait_for("a result is fetched")
    worker.kill()
    run.wait_for(f"{cluster.address} has no workers: the flights wait for one")
    return run


def test_flight_whose_result_is_lost_with_its_worker_flies_again(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(flown)
    with Cluster(tmp_path, FETCHED_LATE) as cluster:
        run = lose_first_result(cluster, "--out", "refetched", "--csv", "--json")
        cluster.add_worker()
        assert run.end() == 0
    assert sorted(event["flight"] for event in flights(run)) == [1, 2, 3, 4]
    assert tables("refetched") == tables("local")


def test_ctrl_c_ends_the_wait_for_a_lost_result(
    flown: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(flown)
    with Cluster(tmp_path, FETCHED_LATE) as cluster:
        run = lose_first_result(cluster, "--out", "interrupted")
        run.interrupt()
        assert run.end() == 130
    assert run.lines[-1] == "gcs: interrupted: 0 of 4 flights are over; the same command continues"


def test_ctrl_c_cancels_the_flights_and_keeps_those_that_are_over(folder: Path, cluster: Cluster) -> None:
    worker = cluster.add_worker()
    run = campaign(cluster)
    wait_until(lambda: FLIES in children_of(worker.popen.pid))
    with ends_of(children_of(worker.popen.pid)[FLIES]):
        run.interrupt()
        assert run.end() == 130
    worker.kill()
    assert run.lines == ["gcs: interrupted: 0 of 3 flights are over; the same command continues"]


def test_ctrl_c_ends_the_wait_for_a_scheduler(folder: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    run = Process("gcs_cli", "campaign", "c.toml", "--scheduler", address)
    wait_until(Path("runs/campaign-c/flights.jsonl").exists)
    run.interrupt()  # while it imports Dask, or waits
    assert run.end() == 130
    (line,) = run.lines
    assert line.startswith("gcs: interrupted")


def test_a_worker_of_another_version_is_refused(folder: Path, cluster: Cluster) -> None:
    worker = cluster.add_worker("import gcs_cli.campaign.installed as i; i.__version__ = '0.0.9'")
    run = campaign(cluster)
    assert run.end() == 2
    worker.kill()
    (line,) = (line for line in run.lines if "no workers" not in line)
    assert line.startswith("gcs: worker tcp://127.0.0.1:")
    assert line.endswith(
        " has flightstack 0.0.9, the client 0.1.0: install the same on the client and on all workers"
    )
    assert Path("runs/campaign-c/flights.jsonl").read_bytes() == b""


def test_a_worker_without_flightstack_is_refused(folder: Path, cluster: Cluster) -> None:
    lacks = "import distributed.versions as v; v._version_cached = lambda name: None"
    worker = cluster.add_worker(lacks)
    worker.wait_for("Registered to")
    run = campaign(cluster)
    assert run.end() == 2
    worker.kill()
    assert run.lines[-1].endswith(" has no flightstack: install the same as on the client")


def test_a_flight_that_is_lost_with_every_worker_is_named(folder: Path, tmp_path: Path) -> None:
    (folder / "c.toml").write_text(ENDLESS.replace("= 3", "= 1"))
    with Cluster(tmp_path, "def dask_setup(scheduler): scheduler.allowed_failures = 0") as cluster:
        worker = cluster.add_worker()
        run = campaign(cluster)
        wait_until(lambda: FLIES in children_of(worker.popen.pid))
        worker.kill()
        assert run.end() == 1
    sentence = "flight 1: it was lost with its worker once; the same command flies it again"
    assert f"gcs: {sentence}" in run.lines


def test_a_campaign_without_its_scheduler_continues_on_this_machine(
    flown: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.chdir(flown)
    with Cluster(tmp_path) as cluster:
        worker = cluster.add_worker()
        run = campaign(cluster, "--out", "lost", "--csv")
        run.wait_for("of 4 flights")
        cluster.scheduler.kill()
        assert run.end() == 3
        worker.end()
    over = len(Path("lost/flights.jsonl").read_text().splitlines())
    lost = f"gcs: the scheduler {cluster.address} was lost: {over} flights are over"
    assert [line for line in run.lines[:-1] if "of 4 flights" not in line] == []
    assert run.lines[-1] == f"{lost}; the same command continues, also without --scheduler"
    with warm_children():
        rest = gcs("campaign", "c.toml", "-j", 1, "--out", "lost", "--csv", "--json")
    assert rest.returncode == 0
    assert rest.stdout.count('"event": "flight"') == 4 - over
    assert tables("lost") == tables("local")
