"""Loops of DO_JUMP that no item to fly interrupts: the vehicle would go round them without moving."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from flightstack.plan.item import MissionItem
from flightstack.plan.vocabulary import NAV_COMMANDS, Command

_UNSEEN, _ON_PATH, _DONE = 0, 1, 2


def find_idle_loop(items: Sequence[MissionItem]) -> int | None:
    """Return the number of a DO_JUMP in a loop without an item to fly, or None.

    Jump targets must be valid. A depth-first search with a stack of its own, linear in the items.
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
    """Yield the items that may follow ``seq`` with no time passing; none when ``seq`` takes time."""
    item = items[seq]
    if item.command in NAV_COMMANDS:
        return
    if item.command == Command.DO_JUMP and item.param2 != 0.0:
        yield int(item.param1)
        if item.param2 < 0.0:  # for ever: what follows is never reached from here
            return
    if seq + 1 < len(items):
        yield seq + 1


def _jump_on_path(items: Sequence[MissionItem], path: list[int], loop_start: int) -> int:
    """Return the last DO_JUMP on the part of ``path`` that is the loop; a loop always has one."""
    loop = path[path.index(loop_start) :]
    return next(seq for seq in reversed(loop) if items[seq].command == Command.DO_JUMP)
