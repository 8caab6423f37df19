"""Consoles print words between colons, such as the parts of a fault, as they are."""

from __future__ import annotations

import io
import re
from pathlib import Path

import pytest
from rich.console import Console

from gcs_cli.fly.fly_display import FlyConsole
from gcs_cli.tables import new_table, table_console

ROOT = Path(__file__).resolve().parents[2]
FAULT = "sensor:mag:turn=170@3.3-9"


@pytest.mark.parametrize("make", [FlyConsole, table_console])
def test_the_notation_of_a_fault_is_no_picture(
    make: type[Console], capsys: pytest.CaptureFixture[str]
) -> None:
    console = make()
    console.file = io.StringIO()
    table = new_table()
    table.add_column("fault")
    table.add_row(FAULT)
    for printed in (FAULT, table):
        console.print(printed, markup=False)
    assert console.file.getvalue().count(FAULT) == 2


def test_no_console_replaces_words_by_pictures() -> None:
    found = 0
    for program in ("gcs_cli", "sim_bridge", "flightstack"):
        for path in (ROOT / program).rglob("*.py"):
            for call in re.findall(r"\bConsole\([^)]*\)", path.read_text(encoding="utf-8")):
                assert "emoji=False" in call, f"{path}: {call}"
                found += 1
    assert found
