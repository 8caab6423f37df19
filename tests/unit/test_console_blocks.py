"""The comparison of the documentation's output with what a command printed."""

from __future__ import annotations

import pytest

from tests.support.console_blocks import shows

PRINTED = "PASS  lost_link  seed 1  margin 0.752 (13 %)  2.7 s\nversion 1.2.3 reached -4.10 m"


@pytest.mark.parametrize(
    ("line", "shown"),
    [
        ("PASS  lost_link  seed 1  margin 0.785 …", True),
        ("PASS  lost_link  seed 1  margin 1.4 …", False),
        ("PASS  lost_link  seed 2  margin 0.752 …", False),
        ("margin 0.75 (13 %) … s", True),
        ("margin 0.75 (14 %)", False),
        ("reached -4.5 m", True),
        ("reached 4.1 m", False),
        ("version 1.2.3", True),
        ("version 1.2.4", False),
    ],
)
def test_a_measured_figure_may_move_a_little_and_nothing_else(line: str, shown: bool) -> None:
    assert shows(PRINTED, line) is shown
