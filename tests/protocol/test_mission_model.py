"""Any interleaving of two ground stations on bad links: plans stay whole, and every answer is true."""

from __future__ import annotations

from functools import cache

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, invariant, rule

from flightstack.mavlink.mission_messages import mission_id
from flightstack.plan import MissionItem, MissionResult, MissionType
from flightstack.services.mission.mission_store import MissionCleared, MissionRefused, MissionReplaced
from gcs_cli.clients.mission_client import Done, Failed, MissionClient
from tests.protocol.mission_harness import LOSSY, GroundStation, World, mission
from tests.support.plan_items import circle, polygon, rally_point, square
from tests.support.tools import NIGHTLY

KINDS = (MissionType.MISSION, MissionType.FENCE, MissionType.RALLY)
SERVICES = st.tuples(st.sampled_from(["one", "two"]), st.sampled_from(KINDS))
Service = tuple[str, MissionType]
Items = tuple[MissionItem, ...]


def plan(kind: MissionType, size: int, mark: int) -> Items:
    """A plan of about ``size`` items that the vehicle takes, told from all others by ``mark``."""
    if kind == MissionType.MISSION:
        return mission(size, mark=mark)
    if kind == MissionType.FENCE:
        corners = polygon(square(50.0 + mark % 1000))
        return (*corners, *(circle((0.0, 0.0), 40.0 + mark + 0.5 * extra) for extra in range(size // 2)))
    return tuple(rally_point((float(index), float(mark)), altitude_m=1.0) for index in range(size))


@cache
def bad_plan(kind: MissionType) -> Items:
    """A plan that the vehicle refuses."""
    if kind == MissionType.MISSION:
        return (*mission(2), MissionItem(31000, 0))
    if kind == MissionType.FENCE:
        return tuple(polygon(square(5.0, at=(100.0, 0.0))))  # leaves out home
    return (rally_point((0.0, 0.0)), *mission(1))


class Transfers(RuleBasedStateMachine):
    """Two clients, each with a service per type of plan, all on one lossy link per client."""

    @initialize(seed=st.integers(0, 2**32))
    def begin(self, seed: int) -> None:
        one = GroundStation("one", LOSSY, seed, 255, mission_types=KINDS)
        two = GroundStation("two", LOSSY, seed + 1, 254, mission_types=KINDS)
        self.world = World(one, two, stored=KINDS)
        self.mark = 0
        self.events_seen = 0
        self.offers: dict[MissionType, set[Items]] = {kind: {()} for kind in KINDS}
        """Every plan that was ever uploaded and is fit to be accepted."""
        self.in_force: dict[MissionType, list[Items]] = {kind: [()] for kind in KINDS}
        """Every plan that was ever in force, in order."""
        self.wishes: dict[Service, Items | None] = {}
        """What each service uploads; None: it downloads."""
        self.since: dict[Service, int] = {}
        """Index of the plan that was in force when the service began."""

    def client(self, service: Service) -> MissionClient:
        return self.world.stations[service[0]].clients[service[1]]

    def note(self, service: Service, wish: Items | None) -> None:
        self.take_events()
        self.wishes[service] = wish
        self.since[service] = len(self.in_force[service[1]]) - 1

    def is_free(self, service: Service) -> bool:
        return service not in self.wishes or self.client(service).result is not None

    @rule(services=st.lists(SERVICES, min_size=1, max_size=4), size=st.integers(1, 12))
    def upload(self, services: list[Service], size: int) -> None:
        for service in filter(self.is_free, services):
            self.mark += 1
            items = plan(service[1], size, self.mark)
            self.offers[service[1]].add(items)
            self.note(service, items)
            self.client(service).start_upload(items)

    @rule(service=SERVICES)
    def upload_what_is_refused(self, service: Service) -> None:
        if self.is_free(service):
            self.note(service, bad_plan(service[1]))
            self.client(service).start_upload(bad_plan(service[1]))

    @rule(services=st.lists(SERVICES, min_size=1, max_size=4))
    def download(self, services: list[Service]) -> None:
        for service in filter(self.is_free, services):
            self.note(service, None)
            self.client(service).start_download()

    @rule(service=SERVICES)
    def clear(self, service: Service) -> None:
        if self.is_free(service):
            self.note(service, ())
            self.client(service).start_clear()

    @rule(service=SERVICES, size=st.integers(1, 12))
    def abort_and_begin_another(self, service: Service, size: int) -> None:
        self.client(service).cancel()
        self.upload([service], size)

    @rule(steps=st.integers(1, 25))
    def let_a_moment_pass(self, steps: int) -> None:
        for _ in range(steps):
            self.world.step()

    @rule(steps=st.integers(25, 150))
    def let_time_pass(self, steps: int) -> None:
        for _ in range(steps):
            self.world.step()

    @rule()
    def let_all_settle(self) -> None:
        self.world.run()
        for service in self.wishes:
            assert self.client(service).result is not None, f"{service} never ends"

    def take_events(self) -> None:
        for event in self.world.events[self.events_seen :]:
            if isinstance(event, MissionReplaced):
                self.in_force[event.mission_type].append(event.items)
            elif isinstance(event, MissionCleared):
                self.in_force[event.mission_type].append(())
            else:
                assert isinstance(event, MissionRefused)
                assert event.reason
        self.events_seen = len(self.world.events)

    @invariant()
    def each_store_holds_one_whole_offered_plan_or_nothing(self) -> None:
        self.take_events()
        for kind in KINDS:
            items = self.world.server.items(kind)
            assert items == self.in_force[kind][-1]
            assert items in self.offers[kind]
            assert self.world.server.plan_id(kind) == mission_id(items)

    @invariant()
    def results_agree_with_what_the_vehicle_did(self) -> None:
        for service, wish in self.wishes.items():
            client = self.client(service)
            result = client.result
            since = self.in_force[service[1]][self.since[service] :]
            if isinstance(result, Failed):
                assert result.reason
                assert result.result != MissionResult.ACCEPTED
            elif isinstance(result, Done) and wish is None:
                assert result.items in since, "a download gave a plan that was not in force"
                assert client.plan_id == mission_id(result.items)
            elif isinstance(result, Done):
                assert wish in since, "an upload or clear succeeded that never took effect"
                assert client.plan_id == mission_id(wish or ())


Transfers.TestCase.settings = settings(max_examples=200 if NIGHTLY else 60, stateful_step_count=40)
TestTransfers = Transfers.TestCase
