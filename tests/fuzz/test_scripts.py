"""Scripts of the coverage-guided fuzz: those it begins with, and those that once found a fault."""

from __future__ import annotations

import pytest

from flightstack.mavlink.dialect import mavlink
from tests.fuzz.clients import SERVICES, log_list
from tests.fuzz.corpus import SCRIPTS
from tests.fuzz.script import written
from tests.fuzz.targets import TARGETS

FOUND = {
    "more logs than numbers up to the last": (
        "session",
        bytes((SERVICES.index(log_list),)) + written([mavlink.MAVLink_log_entry_message(0, 2, 0, 0, 0)]),
    ),
}
"""Inputs that raised once: the target and the script."""


@pytest.mark.parametrize("name", TARGETS)
def test_the_scripts_to_begin_with(name: str) -> None:
    for script in SCRIPTS[name]():
        TARGETS[name](script)


@pytest.mark.parametrize("case", FOUND)
def test_what_was_found_once(case: str) -> None:
    name, script = FOUND[case]
    TARGETS[name](script)
