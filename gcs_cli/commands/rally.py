"""``gcs rally``: the vehicle's list of rally points."""

from __future__ import annotations

from flightstack.plan import MissionType
from gcs_cli.commands.plan_commands import make_part_app

app = make_part_app(MissionType.RALLY)
