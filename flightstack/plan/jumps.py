"""Analysis of DO_JUMP items: loops without a navigation item, and whether a mission takes off."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from flightstack.plan.commands import NAV_COMMANDS, Command
from flightstack.plan.item import MissionItem

LEAVES_GROUND = frozenset({Command.NAV_TAKEOFF, Command.NAV_WAYPOINT, Command.NAV_LOITER_TIME})
STAYS_ON_GROUND = frozenset({Command.NAV_LAND, Command.NAV_RETURN_TO_LAUNCH})
_UNSEEN, _ON_PATH, _DONE = 0, 1, 2


def find_idle_loop(items: Sequence[MissionItem]) -> int | None:
    """Return the number of a DO_JUMP in a loop without a navigation item, or None.

    Jump targets must be valid. Iterative depth-first search, linear in the number of items.
    """
    state = [_UNSEEN] * len(items)
    for start in range(len(items)):
        if state[start] != _UNSEEN:
            continue
        path = [(start, _next_at_once(items, start))]
        state[start] = _ON_PATH
        while path:
            seq, successors = path[-1]
            after = next(successors, None)
            if after is None:
                state[seq] = _DONE
                path.pop()
            elif state[after] == _ON_PATH:
                return _jump_on_path(items, [entry[0] for entry in path], after)
            elif state[after] == _UNSEEN:
                state[after] = _ON_PATH
                path.append((after, _next_at_once(items, after)))
    return None


def _next_at_once(items: Sequence[MissionItem], seq: int) -> Iterator[int]:
    """Yield the items that may follow ``seq`` immediately; none if ``seq`` takes time."""
    if items[seq].command not in NAV_COMMANDS:
        yield from _next(items, seq)


def _next(items: Sequence[MissionItem], seq: int) -> Iterator[int]:
    """Yield the items that may follow ``seq``."""
    item = items[seq]
    if item.command == Command.DO_JUMP and item.param2 != 0.0:
        yield int(item.param1)
        if item.param2 < 0.0:  # endless: the next item is never reached from here
            return
    if seq + 1 < len(items):
        yield seq + 1


def takes_off(items: Sequence[MissionItem], start: int = 0) -> bool:
    """Return True if a landed vehicle that continues at item ``start`` takes off.

    It does at a takeoff or position item, unless a landing, a return or an endless loop of delays comes first.
    """
    ahead, seen = [start], set()
    while ahead:
        seq = ahead.pop()
        if seq in seen or seq >= len(items):
            continue
        seen.add(seq)
        command = items[seq].command
        if command in LEAVES_GROUND:
            return True
        if command not in STAYS_ON_GROUND:
            ahead.extend(_next(items, seq))
    return False


def _jump_on_path(items: Sequence[MissionItem], path: list[int], loop_start: int) -> int:
    """Return the last DO_JUMP of the loop at the end of ``path``."""
    loop = path[path.index(loop_start) :]
    return next(seq for seq in reversed(loop) if items[seq].command == Command.DO_JUMP)
