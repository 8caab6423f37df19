"""Random plans."""

from __future__ import annotations

from hypothesis import strategies as st

from flightstack.core.geodesy import GeoPoint
from flightstack.plan import UNSET_E7, Command, Frame, MissionItem, Plan


@st.composite
def items(draw: st.DrawFn, count: int) -> MissionItem:
    command = draw(st.sampled_from([*Command, 82, 206]))  # with commands and frames of other vehicles
    frame = draw(st.sampled_from([*Frame, 10]))
    params = [draw(FLOATS) for _ in range(5)]
    x, y = draw(st.integers(-(10**9) + 10**8, 9 * 10**8)), draw(st.integers(-18 * 10**8, 18 * 10**8))
    if frame != Frame.MISSION and command in (Command.NAV_TAKEOFF, Command.NAV_LAND) and draw(st.booleans()):
        x = y = UNSET_E7
    if command == Command.DO_JUMP:
        params[0] = float(draw(st.integers(0, count - 1)))
    return MissionItem(command, frame, *params[:4], x, y, params[4], draw(st.booleans()))  # type: ignore[misc]


@st.composite
def plans(draw: st.DrawFn) -> Plan:
    count = draw(st.integers(1, 8))
    degrees = st.integers(-8 * 10**8, 8 * 10**8).map(lambda value: value / 1e7)
    home = GeoPoint(draw(degrees), draw(degrees), draw(st.floats(-400, 8000)))
    return Plan(tuple(draw(items(count)) for _ in range(count)), home)


FLOATS = st.floats(width=32, allow_infinity=False)
