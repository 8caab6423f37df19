"""Campaigns on a cluster: what a worker gets, what it refuses, and usage errors; no Dask process."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from flightstack.testing.scenario import load_scenario
from gcs_cli.campaign import cluster
from gcs_cli.campaign.installed import difference, digests, installation
from gcs_cli.campaign.order import Files, below, without_root
from gcs_cli.scenarios.result import Result, Wanted, not_flown
from gcs_cli.scenarios.selection import Case
from tests.support.commands import gcs

ROOT = Path(__file__).resolve().parents[2]
PLAN = (ROOT / "missions/hop.plan").read_bytes()


def case_of(path: Path, text: str) -> Case:
    path.write_text(f"{text}[expect]\n", encoding="utf-8")
    return Case(load_scenario(path), 1, "a", "")


@pytest.mark.parametrize("is_absolute", [False, True], ids=["relative", "absolute"])
def test_an_order_flies_without_the_files_of_the_client(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, is_absolute: bool
) -> None:
    here, root = tmp_path / "client/here", tmp_path / "worker"
    here.mkdir(parents=True)
    monkeypatch.chdir(here)
    vehicle, plan, later = here.parent / "v.toml", here / "p.plan", here.parent / "later.plan"
    vehicle.write_bytes((ROOT / "flightstack/params/vehicles/x_quad.toml").read_bytes())
    plan.write_bytes(PLAN)
    later.write_bytes(PLAN)
    names = (vehicle, plan, later) if is_absolute else ("../v.toml", "p.plan", "../later.plan")
    text = "vehicle = '{}'\nplan = '{}'\nevent = [{{at_s = 1, upload = '{}'}}]\n".format(*names)
    case = case_of(here / "c.toml" if is_absolute else Path("c.toml"), text)
    order = Files().order(case, Wanted())
    (tmp_path / "client").rename(tmp_path / "gone")
    there = below(root, str(here))
    there.mkdir(parents=True)
    monkeypatch.chdir(there)
    setup = order.place(root).scenario.setup(1)
    assert setup.check().mass_kg == 1.5
    assert setup.load_plan("../later.plan" if not is_absolute else below(root, str(later))).items


def test_an_order_names_files_of_the_installation_only(tmp_path: Path) -> None:
    order = Files().order(case_of(tmp_path / "c.toml", "plan = 'hop'\n"), Wanted())
    assert (order.files, order.installed) == ({}, digests([ROOT / "missions/hop.plan"]))


@pytest.mark.parametrize(
    ("wanted", "found", "sentence"),
    [
        (installation(), installation(), ""),
        ({"flightstack": "2"}, {"flightstack": "1"}, "has flightstack 1, the client 2"),
        ({"numpy": "2.4"}, {"numpy": "2.3"}, "has numpy 2.3, the client 2.4"),
        ({"sources": "a"}, {"sources": "b"}, "has other source code of flightstack than the client"),
        ({"hop.plan": "a"}, {"hop.plan": "b"}, "has another hop.plan than the client"),
    ],
)
def test_difference_of_two_installations_is_named(
    wanted: dict[str, str], found: dict[str, str], sentence: str
) -> None:
    assert difference(wanted, found) == sentence


def test_files_of_one_name_are_compared_together(tmp_path: Path) -> None:
    files = [tmp_path / folder / "__init__.py" for folder in "ab"]
    for path in files:
        path.parent.mkdir()
        path.write_text(str(path))
    before = digests(files)
    files[0].write_text("changed")
    assert difference(before, digests(files)) == "has another __init__.py than the client"


def test_no_file_of_an_order_is_outside_its_root() -> None:
    root = Path("/tmp/root")
    assert below(root, "/a/../../../etc/p.plan") == root / "etc/p.plan"
    assert below(root, "../p.plan") == root / "p.plan"


def test_text_of_an_error_has_the_paths_of_the_client(tmp_path: Path) -> None:
    result = without_root(not_flown(f"{tmp_path}/home/a/p.plan: cannot be read"), tmp_path)
    assert result.outcome_text == "/home/a/p.plan: cannot be read"
    assert [check.found for check in result.checks] == ["/home/a/p.plan: cannot be read"]
    passed = Result((), outcome="completed")
    assert without_root(passed, tmp_path) is passed


CAMPAIGN = (
    "vehicle = 'x_quad'\nduration_s = 1\n[campaign]\n[vary]\nwind.gust_m_s = {uniform = [0, 1]}\n[expect]\n"
)


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        (
            ["--scheduler", "tcp://127.0.0.1:1", "--workers", "2"],
            "--workers is for this machine: leave it out, the cluster has workers of its own",
        ),
        (
            ["--scheduler", "127.0.0.1:1"],
            "--scheduler: 127.0.0.1:1 is no address of a scheduler, such as tcp://10.0.0.1:8786",
        ),
        (
            ["--scheduler", "http://127.0.0.1:1"],
            "--scheduler: http://127.0.0.1:1 is no address of a scheduler, such as tcp://10.0.0.1:8786",
        ),
    ],
    ids=["workers", "no scheme", "other scheme"],
)
def test_wrong_options_of_a_cluster_exit_with_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str], sentence: str
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("c.toml").write_text(CAMPAIGN)
    ended = gcs("campaign", "c.toml", *arguments)
    assert (ended.returncode, ended.stdout, ended.stderr) == (2, "", f"gcs: {sentence}\n")


def test_cluster_without_its_library_names_the_extra(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(sys.modules, "distributed", None)
    Path("c.toml").write_text(CAMPAIGN)
    ended = gcs("campaign", "c.toml", "--scheduler", "tcp://127.0.0.1:1")
    sentence = "gcs: --scheduler needs distributed: pip install 'flightstack[cluster]'\n"
    assert (ended.returncode, ended.stderr) == (2, sentence)


def test_unreachable_scheduler_exits_with_3(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cluster, "ANSWER_S", 0.2)
    Path("c.toml").write_text(CAMPAIGN)
    ended = gcs("campaign", "c.toml", "--scheduler", "tcp://127.0.0.1:1")
    assert (ended.returncode, ended.stdout) == (3, "")
    assert ended.stderr == (
        "gcs: --scheduler tcp://127.0.0.1:1: no Dask scheduler answers: start one with `dask scheduler`, or check the "
        "address\n"
    )
