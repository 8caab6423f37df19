"""Parameters that say who the vehicle is: read once, at its start."""

from __future__ import annotations

from flightstack.params.spec import ParamSpec, group_of

SYSTEM_ID, AUTOPILOT = "MAV_SYS_ID", "FS_AUTOPILOT"
PX4_COMPATIBLE, GENERIC = 0, 1
"""Values of FS_AUTOPILOT."""


def identity_specs(system_id: int) -> tuple[ParamSpec, ...]:
    """Return their declarations; ``system_id`` is the one that the configuration gives by default."""
    return (
        ParamSpec(
            SYSTEM_ID, system_id, 1, 250, "", "MAVLink system id", True, group_of(SYSTEM_ID), 0, (), True
        ),
        ParamSpec(
            AUTOPILOT, PX4_COMPATIBLE, 0, 1, "", "What the vehicle calls itself to ground stations", True,
            group_of(AUTOPILOT), 0,
            ((PX4_COMPATIBLE, "PX4, whose modes and altitudes it has"), (GENERIC, "Generic autopilot")), True,
        ),
    )  # fmt: skip
