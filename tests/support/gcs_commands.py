"""The commands of ``gcs`` that wait for a vehicle."""

from __future__ import annotations

from pathlib import Path

PLAN = Path(__file__).parents[2] / "missions" / "fenced_square.plan"
ON_VEHICLE = {
    "arm": [], "disarm": [], "takeoff": [], "land": [], "rtl": [], "hold": [], "goto": ["47.4", "8.5"], "yaw": ["90"],
    "speed": ["3"], "mode": ["hold"], "set-home": [], "terminate": ["--yes"], "inject": ["gps", "off"], "reboot": [],
    "wait": ["armed"], "status": [], "messages": [], "listen": ["ATTITUDE"], "send": ["HEARTBEAT"],
    "record": ["x.tlog"], "shell": ["-c", "arm"], "perf": [], "watch": ["--once"],
    "mission upload": [str(PLAN)], "mission download": ["x.plan"], "mission verify": [str(PLAN)], "mission clear": [],
    "mission start": [], "mission pause": [], "mission resume": [], "mission jump": ["1"],
    "mission check": [str(PLAN), "--vehicle"], "mission show": [],
    "fence upload": [str(PLAN)], "fence download": ["x.plan"], "fence show": [], "fence verify": [str(PLAN)],
    "fence clear": [], "rally upload": [str(PLAN)], "rally download": ["x.plan"], "rally show": [],
    "rally verify": [str(PLAN)], "rally clear": [],
    "param list": [], "param search": ["speed"], "param get": ["MAV_SYS_ID"], "param set": ["MAV_SYS_ID", "1"],
    "param reset": ["MAV_SYS_ID"], "param save": ["x.params"], "param load": ["given.params"], "param diff": [],
    "log list": [], "log download": [], "log erase": ["--yes"],
}  # fmt: skip
"""Commands that wait for a vehicle, with arguments."""
