"""All panels of the terminal view."""

from __future__ import annotations

from gcs_cli.tui.fly.compact import compact
from gcs_cli.tui.fly.flight_display import flight_display
from gcs_cli.tui.fly.health_panels import health_panel, link_panel
from gcs_cli.tui.fly.panels import messages_panel, mission_panel, position_panel, power_panel
from gcs_cli.tui.fly.timing_panels import timing_panel
from gcs_cli.tui.status_line import status_line

PANELS = [
    flight_display, position_panel, power_panel, health_panel, link_panel, mission_panel, timing_panel,
    messages_panel, compact, status_line,
]  # fmt: skip
