"""What denies arming: each reason, all at once, and what is switched off."""

from __future__ import annotations

import math

import pytest

from flightstack.commander.arming_checks import ArmingFacts, arming_refusals
from flightstack.commander.transitions import TERMINATED, Need
from flightstack.core.enums import Mode
from flightstack.params.behaviour import Behaviour, with_assignments

# ---------------------------------------------------------------------- arming

READY = ArmingFacts(
    mode=Mode.HOLD, state_is_valid=True, state_is_fresh=True, upright=True, gcs_lost=False, gcs_heard=True,
    manual_fresh=False, offboard_fresh=False, fence_breach="", battery_level=0, battery_remaining=math.nan,
)  # fmt: skip


def test_a_vehicle_that_is_ready_arms() -> None:
    assert arming_refusals(READY, Behaviour()) == ()


@pytest.mark.parametrize(
    ("change", "params", "reason"),
    [
        ({"state_is_valid": False, "upright": False}, [], Need.STATE.value),
        ({"state_is_fresh": False}, [], "the state is frozen or missing"),
        ({"upright": False}, [], Need.UPRIGHT.value),
        ({"battery_level": 1, "battery_remaining": 0.12}, [], "the battery is low: 12% left"),
        ({}, ["BAT_LOW_THR=0.12", "BAT_CRIT_THR=0.2"], "BAT_EMERGEN_THR, BAT_CRIT_THR and BAT_LOW_THR"),
        ({"fence_breach": "is outside the geofence"}, [], "the vehicle is outside the geofence"),
        ({"gcs_lost": True}, ["NAV_DLL_ACT=1"], "the ground station is lost"),
        ({"gcs_heard": False}, ["NAV_DLL_ACT=1"], "no ground station was heard"),
        (
            {"mode": Mode.ALTITUDE, "manual_fresh": True, "throttle": 0.21},
            [],
            "the throttle is above the centre",
        ),
        ({"mode": Mode.POSITION}, [], Need.MANUAL_STREAM.value),
        ({"mode": Mode.ALTITUDE}, [], Need.MANUAL_STREAM.value),
        ({"mode": Mode.OFFBOARD}, [], Need.OFFBOARD_STREAM.value),
        ({"mode_fault": Need.MISSION.value}, [], Need.MISSION.value),
        ({"mode": Mode.TERMINATION}, [], TERMINATED),
    ],
)
def test_each_reason_has_its_sentence(change: dict[str, object], params: list[str], reason: str) -> None:
    facts = READY._replace(**change)
    (sentence,) = arming_refusals(facts, with_assignments(Behaviour(), params))
    assert sentence.startswith(reason)


def test_all_reasons_are_given_at_once() -> None:
    facts = READY._replace(upright=False, battery_level=2, battery_remaining=0.06, gcs_lost=True)
    assert len(arming_refusals(facts, Behaviour().updated("NAV_DLL_ACT", 2))) == 3


def test_what_is_switched_off_does_not_keep_the_vehicle_on_the_ground() -> None:
    facts = READY._replace(gcs_lost=True, fence_breach="is outside the geofence")
    off = with_assignments(Behaviour(), ["NAV_DLL_ACT=0", "GF_ACTION=0"])
    assert arming_refusals(facts, off) == ()
