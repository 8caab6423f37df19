"""The paper's processor in the loop as ``gcs paper`` runs it: real processes, an emulated Cortex-M4F."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from flightstack.testing.instances import free_instance
from gcs_cli.experiments.paper import pil_section
from tests.support.warm_children import warm_children

emulation = pytest.mark.skipif(
    not all(map(importlib.util.find_spec, ("unicorn", "ziglang"))), reason="unicorn and ziglang are extras"
)


@emulation
def test_the_paper_controller_gives_the_same_bits_on_the_target_and_replaces_an_older_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        pil_section, "TRAJECTORY", "step_z"
    )  # a metre up and down again: the shortest mission
    monkeypatch.setattr(pil_section, "FLOWN", (("backstepping", "paper"), ("backstepping", "rigid")))
    older = tmp_path / "pil-backstepping"
    older.mkdir()
    (older / "pil.json").write_text("{}")
    told: list[str] = []
    with warm_children():
        found = pil_section.run(tmp_path, tell=told.append, instance=free_instance())
    assert told == ["processor in the loop: backstepping", "processor in the loop: backstepping, rigid"]
    assert found["why_left_out"] is None
    assert "stands for no board" in found["meaning"]
    of, rigid = found["controllers"]["backstepping"], found["rigid"]["backstepping"]
    for one in (of, rigid):
        assert one["verdict"] == "passed", [check for check in one["checks"] if not check["passed"]]
        rows = [row for row in one["differences"] if row["pair"] == "SIL–PIL"]
        assert len(rows) > 10
        assert all(row["largest"] == 0.0 for row in rows)
    assert rigid["differences"] == of["differences"]  # the plants are equal in a vertical step
    whole = of["profile"]["stages"]["whole"]
    assert of["profile"]["unit"] == "instructions"
    assert whole["count"] == of["flights"]["PIL"]["ticks"] == sum(whole["histogram"]["counts"]) > 3000
    assert json.loads((older / "pil.json").read_text())["differences"] == of["differences"]
    assert (older / "pil.html").exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["pil-backstepping", "pil-backstepping-rigid"]
    text = json.dumps(found)
    assert "wall" not in text
    assert "round_trip" not in text
    assert str(tmp_path) not in text
