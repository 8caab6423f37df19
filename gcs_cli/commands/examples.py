"""Examples at the end of each command's help, by the words of the command; ``fence`` and ``rally`` have the same.

A module of its own: a page of texts.
"""

from __future__ import annotations

_PLAN_PARTS = {
    f"{part} {command}": tuple(f"gcs {part} {line}" for line in lines)
    for part in ("fence", "rally")
    for command, lines in {
        "upload": ("upload fenced_square",),
        "download": ("download", f"download {part}.plan --overwrite"),
        "show": ("show fenced_square", "show --json"),
        "verify": ("verify fenced_square",),
        "clear": ("clear", "clear --system 2"),
    }.items()
}

EXAMPLES: dict[str, tuple[str, ...]] = {
    "fly": ("gcs fly", "gcs fly survey.plan --wind 3,0 --gust 1 --seed 7 --open", "gcs fly hop --json"),
    "sim": ("gcs sim", "gcs sim --vehicles 3 --spacing 5", "gcs sim --param MPC_XY_CRUISE=3 --wind 4,0"),
    "paper": ("gcs paper --no-pil", "gcs paper --out results --jobs 4 --open"),
    "test": (
        "gcs test missions",
        "gcs test -k wind --repeat 20 --seed 1",
        "gcs test -j 4 --junit results.xml --report results.html",
    ),
    "campaign": (
        "gcs campaign gusts.toml --workers 4 --out results --csv",
        "gcs campaign gusts.toml --only 17",
        "gcs campaign gusts.toml --seek worst",
    ),
    "arm": ("gcs arm", "gcs arm --system 2"),
    "disarm": ("gcs disarm", "gcs disarm --force --yes"),
    "takeoff": ("gcs takeoff --alt 10", "gcs takeoff --no-wait"),
    "land": ("gcs land", "gcs land --no-wait"),
    "rtl": ("gcs rtl", "gcs rtl --no-wait"),
    "hold": ("gcs hold",),
    "goto": ("gcs goto 47.3979 8.5459 --alt 20", "gcs goto -35.3632 149.1652"),
    "yaw": ("gcs yaw 90",),
    "speed": ("gcs speed 3.5", "gcs speed -2"),
    "mode": ("gcs mode", "gcs mode position"),
    "set-home": ("gcs set-home", "gcs set-home 47.3977 8.5456 488"),
    "terminate": ("gcs terminate", "gcs terminate --yes"),
    "inject": ("gcs inject motor off --number 2", "gcs inject gps off", "gcs inject gps ok"),
    "reboot": ("gcs reboot", "gcs reboot --timeout 60"),
    "wait": ("gcs wait ready", "gcs wait 'altitude>10' mode=HOLD", "gcs wait disarmed --timeout 300"),
    "status": ("gcs status", "gcs status --instance 1", "gcs --connect tcp:127.0.0.1:5760 status --json"),
    "watch": ("gcs watch", "gcs watch --screen map", "gcs watch --once"),
    "messages": (
        "gcs messages --level warning",
        "gcs messages --past 100 --duration 0",
        "gcs --connect flight.tlog messages --json",
    ),
    "listen": (
        "gcs listen",
        "gcs listen ATTITUDE --field roll --field pitch",
        "gcs listen ESC_STATUS --rate 10 --count 5 --json",
    ),
    "send": (
        "gcs send COMMAND_LONG command=DO_SET_SERVO param1=9 param2=1500",
        "gcs send STATUSTEXT severity=INFO text=hello",
        "gcs send MANUAL_CONTROL z=500 --rate 20 --count 100",
    ),
    "record": (
        "gcs record flight.tlog",
        "gcs --connect serial:/dev/ttyACM0 record bench.tlog --duration 60",
    ),
    "shell": ("gcs shell", "gcs shell -c arm -c 'takeoff --alt 5'", "gcs --system 2 shell checks.gcs"),
    "perf": ("gcs perf", "gcs perf --watch"),
    "replay": ("gcs replay flight.ulg", "gcs replay flight.tlog --speed 4 --from 60 --loop"),
    "report": ("gcs report flight.ulg --open", "gcs report flight.ulg --out flight.html --overwrite"),
    "compare": ("gcs compare before.ulg after.ulg", "gcs compare runs/a runs/b --out difference.html"),
    "mission new": (
        "gcs mission new square --size 40 --altitude 10",
        "gcs mission new circle --laps 3 --out circle.plan",
        "gcs mission new survey field.kml --spacing 15 --angle 30",
    ),
    "mission check": ("gcs mission check survey.plan", "gcs mission check survey.plan --vehicle"),
    "mission show": (
        "gcs mission show square",
        "gcs mission show survey.plan --html survey.html",
        "gcs mission show --json",
    ),
    "mission convert": (
        "gcs mission convert survey.plan survey.waypoints",
        "gcs mission convert track.gpx track.plan --altitude 20",
    ),
    "mission upload": ("gcs mission upload square", "gcs mission upload survey.plan --system 2"),
    "mission download": ("gcs mission download", "gcs mission download vehicle.plan --overwrite"),
    "mission verify": ("gcs mission verify survey.plan",),
    "mission clear": ("gcs mission clear", "gcs mission clear --type fence"),
    "mission start": ("gcs mission start", "gcs mission start --no-wait"),
    "mission pause": ("gcs mission pause",),
    "mission resume": ("gcs mission resume",),
    "mission jump": ("gcs mission jump 3",),
    **_PLAN_PARTS,
    "param list": ("gcs param list", "gcs param list 'MPC_*'", "gcs param list --json"),
    "param search": ("gcs param search return altitude", "gcs param search battery --most 5"),
    "param get": ("gcs param get MPC_XY_CRUISE", "gcs param get 'MPC_*_VEL_*' --json"),
    "param set": ("gcs param set MPC_XY_CRUISE 3.5",),
    "param reset": ("gcs param reset MPC_XY_CRUISE", "gcs param reset --all"),
    "param save": ("gcs param save vehicle.params", "gcs param save vehicle.params --overwrite"),
    "param load": ("gcs param load vehicle.params",),
    "param diff": ("gcs param diff", "gcs param diff vehicle.params"),
    "log list": ("gcs log list", "gcs log list --json"),
    "log download": (
        "gcs log download latest",
        "gcs log download 3 --out flight.ulg",
        "gcs log download --all --out logs",
    ),
    "log erase": ("gcs log erase --yes",),
    "estimate": (
        "gcs estimate flight.ulg",
        "gcs estimate flight.ulg.xz --json",
        "gcs estimate flight.ulg --out estimate.html",
    ),
    "log info": ("gcs log info flight.ulg", "gcs log info flight.tlog --json"),
    "log plot": (
        "gcs log plot flight.ulg vehicle_local_position.z",
        "gcs log plot flight.tlog 'ATTITUDE.*' --from 10 --to 30 --html attitude.html",
    ),
    "log export": (
        "gcs log export flight.ulg --csv tables",
        "gcs log export flight.tlog --mcap flight.mcap --parquet tables",
    ),
    "log draw": (
        "gcs log draw flight.ulg --png flight.png --at 12",
        "gcs log draw runs/square --video flight.mp4 --camera side",
    ),
    "pil fly": ("gcs pil fly square", "gcs pil fly hop --target serial:/dev/ttyUSB1:921600 --open"),
    "pil replay": ("gcs pil replay flight.ulg", "gcs pil replay flight.ulg --target host --fail-over"),
    "pil vectors": ("gcs pil vectors excitation.csv", "gcs pil vectors flight.mat --log flight.ulg"),
    "pil free-run": ("gcs pil free-run hop --target host",),
    "pil generate": (
        "gcs pil generate --controller lqr",
        "gcs pil generate --controller lqr --out build/lqr",
    ),
    "pil build": ("gcs pil build nucleo-f446re", "gcs pil build pico2 --baud 921600 --controller lqr"),
    "pil doctor": (
        "gcs pil doctor --target emulated",
        "gcs pil doctor --port /dev/ttyUSB1 --baud 921600",
        "gcs pil doctor --port /dev/ttyACM0 --conformance",
    ),
}


def epilog(command: str) -> str | None:
    """Return the end of a command's help; None without examples. Click keeps the lines of a paragraph marked so."""
    lines = EXAMPLES.get(command)
    return None if lines is None else "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])
