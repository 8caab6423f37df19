"""Options of the simulator that name state and clock of the flight stack."""

from __future__ import annotations

import pytest

from sim_bridge.command import check_arguments
from sim_bridge.errors import UsageProblemError


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--state=guessed"], "--state: guessed: is not one of estimated, truth"),
        (["--clock=sundial"], "--clock: sundial: is not one of lockstep, realtime"),
        (["--state=truth", "--clock="], "--clock: : is not one of lockstep, realtime"),
    ],
)
def test_an_unknown_state_or_clock_of_the_flight_stack_is_refused(words: list[str], said: str) -> None:
    with pytest.raises(UsageProblemError) as error:
        check_arguments(words)
    assert str(error.value).startswith(said)


def test_state_and_clock_of_the_flight_stack_may_be_unknown() -> None:
    for words in ([], ["--state=truth"], ["--clock=realtime"]):
        check_arguments(words)
