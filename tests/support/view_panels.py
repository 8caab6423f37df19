"""All panels of the terminal view."""

from __future__ import annotations

from gcs_cli.tui.compact import compact
from gcs_cli.tui.flight_display import flight_display
from gcs_cli.tui.health_panels import health_panel, link_panel
from gcs_cli.tui.panels import messages_panel, mission_panel, position_panel, power_panel
from gcs_cli.tui.status_line import status_line
from gcs_cli.tui.timing_panels import timing_panel

PANELS = [
    flight_display, position_panel, power_panel, health_panel, link_panel, mission_panel, timing_panel,
    messages_panel, compact, status_line,
]  # fmt: skip
