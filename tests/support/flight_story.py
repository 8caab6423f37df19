"""A flight of ``gcs fly`` with a fake vehicle, in memory and in simulated time."""

from __future__ import annotations

from dataclasses import dataclass, field

from flightstack.plan import Command, Frame, MissionItem, Plan
from gcs_cli.fly.flight import Flight, Phase
from gcs_cli.link.session import Session
from gcs_cli.report.flight_outcome import Code
from tests.support.fake_vehicle import ARM, RETURN, SHUT_DOWN, START, FakeVehicle

STEP_S = 0.05
TAKEOFF = MissionItem(Command.NAV_TAKEOFF, Frame.GLOBAL_RELATIVE_ALT, x=473977420, y=85455940, z=3.0)
WAYPOINT = MissionItem(Command.NAV_WAYPOINT, Frame.GLOBAL_RELATIVE_ALT, x=473978320, y=85455940, z=3.0)
LAND = MissionItem(Command.NAV_LAND, Frame.GLOBAL_RELATIVE_ALT, x=473977420, y=85455940)
HOP = (TAKEOFF, WAYPOINT, LAND)


@dataclass
class Story:
    """A flight with a fake vehicle; ``now_s`` is the common clock."""

    vehicle: FakeVehicle
    items: tuple[MissionItem, ...] = HOP
    fence: tuple[MissionItem, ...] = ()
    rally: tuple[MissionItem, ...] = ()
    connect_s: float = 10.0
    limit_s: float = 3600.0
    now_s: float = 100.0
    phases: list[Phase] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.session = Session()
        plan = Plan(self.items, fence=self.fence, rally=self.rally)
        self.flight = Flight(self.session, plan, self.now_s, self.connect_s, self.limit_s)

    def run(self, most_s: float = 60.0, until: Phase = Phase.OVER) -> Story:
        end_s = self.now_s + most_s
        while self.flight.phase is not until:
            assert self.now_s < end_s, f"still {self.flight.phase} after {most_s} s"
            for frame in self.session.poll(self.now_s):
                self.vehicle.receive(frame, self.now_s)
            for frame in self.vehicle.poll(self.now_s):
                self.session.receive(frame, ("fake", 1), self.now_s)
            self.flight.step(self.now_s)
            if not self.phases or self.phases[-1] is not self.flight.phase:
                self.phases.append(self.flight.phase)
            self.now_s += STEP_S
        return self

    @property
    def reason(self) -> str:
        assert self.flight.outcome is not None
        return self.flight.outcome.reason

    @property
    def outcome(self) -> Code:
        assert self.flight.outcome is not None
        return self.flight.outcome.code

    @property
    def code(self) -> int:
        assert self.flight.outcome is not None
        return self.flight.outcome.exit_code

    @property
    def orders(self) -> list[int]:
        return [command for command, _ in self.vehicle.commands if command in (ARM, START, SHUT_DOWN, RETURN)]
