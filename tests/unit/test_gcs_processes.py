"""Which of two processes that ended is named: the one that made the other end, whichever was seen to end first."""

from __future__ import annotations

import signal
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

from gcs_cli.fly.processes import Child, Children, culprit, is_explained


class Ended(NamedTuple):
    """A process; without an exit code it still runs."""

    name: str
    exit_code: int | None
    blames_another: bool = False


KILL = -signal.SIGKILL
SIM_RUNS, STACK_RUNS = Ended("sim", None), Ended("stack", None)

STORIES = [
    # what becomes of simulator and flight stack, and who is named
    (Ended("sim", KILL), Ended("stack", 1, True), "sim"),
    (Ended("sim", 1, True), Ended("stack", KILL), "stack"),
    (Ended("sim", 0), Ended("stack", 1, True), "sim"),
    (Ended("sim", 0), Ended("stack", 0, True), "sim"),
    (Ended("sim", 0), Ended("stack", 0), "stack"),  # the flight stack stopped; the simulator ended in order
    (Ended("sim", 1), Ended("stack", 1, True), "sim"),  # the plant diverged
    (Ended("sim", 1, True), Ended("stack", 2), "stack"),
]


@pytest.mark.parametrize(("sim", "stack", "named"), STORIES)
@pytest.mark.parametrize("first", ["sim", "stack"])
def test_the_same_is_named_whoever_ends_first(sim: Ended, stack: Ended, named: str, first: str) -> None:
    """Half-way through, either the story is told rightly already or it is not believed to be explained."""
    half = (sim, STACK_RUNS) if first == "sim" else (SIM_RUNS, stack)
    if is_explained(half):
        found = culprit(half)
        assert found is not None
        assert found.name == named
    assert is_explained((sim, stack))
    found = culprit((sim, stack))
    assert found is not None
    assert found.name == named


def test_who_fails_alone_is_named_at_once() -> None:
    """The other waits for it in vain, and its user should not wait too."""
    assert is_explained((Ended("sim", 2), STACK_RUNS))
    assert is_explained((Ended("sim", KILL), STACK_RUNS))
    assert is_explained((SIM_RUNS, Ended("stack", 2)))
    assert is_explained((SIM_RUNS, Ended("stack", 0)))


def test_nobody_is_named_while_nobody_has_ended() -> None:
    assert not is_explained((SIM_RUNS, STACK_RUNS))
    assert culprit((SIM_RUNS, STACK_RUNS)) is None


def test_who_ends_in_order_or_blames_the_other_waits_for_it() -> None:
    assert not is_explained((Ended("sim", 0), STACK_RUNS))
    assert not is_explained((Ended("sim", 1, True), STACK_RUNS))
    assert not is_explained((SIM_RUNS, Ended("stack", 1, True)))


def test_notices_of_a_child_are_read_once_and_in_whole_lines(tmp_path: Path) -> None:
    program = "import sys; sys.stdout.write(sys.argv[1])"
    said = (
        "sim-bridge: paper_quad, rigid plant\nsim-bridge: warning: the wind has no effect\n"
        "/lib/numpy.py:12: RuntimeWarning: overflow\nflightstack: compiling kernel 1 of 9: detect\n"
        "flightstack: shut down by the ground station\nflightstack: warning: half a"
    )
    with Children(tmp_path) as children:
        child = Child.start("sim-bridge", [sys.executable, "-c", program, said], tmp_path / "sim-bridge.log")
        children.add(child)
        assert children.wait(60.0)
        assert children.notices() == [
            "sim-bridge: warning: the wind has no effect",
            "/lib/numpy.py:12: RuntimeWarning: overflow",
            "flightstack: compiling kernel 1 of 9: detect",
        ]
        assert children.notices() == []
        with (tmp_path / "sim-bridge.log").open("a") as log:
            log.write(" line\n")
        assert children.notices() == ["flightstack: warning: half a line"]
