"""What must not change unasked, compared before and after each arrival."""

from __future__ import annotations

from flightstack.mavlink.frames import FrameFinder
from flightstack.mavlink.link import Link, Message
from flightstack.services.routing.peer import PeerAddress
from tests.support.truth import World

_CHANGES_PARAMETERS = {"PARAM_SET", "COMMAND_LONG", "COMMAND_INT"}
_CHANGES_LOOPS = {*_CHANGES_PARAMETERS, "SET_MODE"}  # arming resets them
_CHANGES_PLANS = {"MISSION_ITEM", "MISSION_ITEM_INT", "MISSION_CLEAR_ALL", "MISSION_COUNT"}


class Guard:
    """Watches plans, parameters and the control loops' memory of one vehicle."""

    def __init__(self, world: World) -> None:
        self._world, self._stack = world, world.engine.stack
        self.plan_changes = self.parameter_changes = 0
        self.after_tick()

    def after_tick(self) -> None:
        """Take what there is now as right."""
        self._seen = self._content()

    def after(self, data: bytes, peer: PeerAddress, may_change: bool) -> None:
        """Check that ``data`` of ``peer`` changed nothing but what its messages may, with an acknowledgement."""
        now, before = self._content(), self._seen
        if now == before:
            return
        self._seen = now
        assert may_change, "a frame without a right signature changed the vehicle"
        kinds = {message.get_type() for message in messages_in(data)}
        assert now[0] == before[0] or kinds & _CHANGES_LOOPS, kinds
        if now[1] != before[1]:
            self.plan_changes += 1
            assert kinds & _CHANGES_PLANS, kinds
            assert any(m.get_type() == "MISSION_ACK" and m.type == 0 for m in self._answers(peer))
        if now[2] != before[2]:
            self.parameter_changes += 1
            assert kinds & _CHANGES_PARAMETERS, kinds

    def _content(self) -> tuple[object, object, object]:
        stack, loops = self._stack, self._stack.loops
        memory = loops.memory.tobytes() + loops.outer_memory.tobytes()
        plans = (stack.places.ids, stack.parts.mission.items)
        return memory, plans, stack.params.values()

    def _answers(self, peer: PeerAddress) -> list[Message]:
        """Return what is sent to ``peer`` now."""
        polled = self._stack.ground.poll(self._world.time_s)
        return [message for address, data in polled if address == peer for message in messages_in(data)]


def messages_in(data: bytes) -> list[Message]:
    """Return every message that may be read out of ``data``."""
    link = Link(0, 0)
    return [message for frame in FrameFinder().find(data) for message in link.decode(frame)]
