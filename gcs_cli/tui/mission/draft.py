"""The plan that the user edits: follows the vehicle's until it is changed; with undo. Pure."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

from flightstack.plan import Plan
from gcs_cli.plans.edit import Items

_UNDO_STEPS = 200
_EMPTY = Plan(())


class MissionDraft(NamedTuple):
    """An edited plan. ``source`` is the vehicle's plan when it was last read."""

    plan: Plan = _EMPTY
    source: Plan = _EMPTY
    past: tuple[Plan, ...] = ()
    """The plans before each edit, oldest first."""
    is_edited: bool = False
    system_id: int | None = None
    """The vehicle whose plan was edited."""

    @property
    def is_changed(self) -> bool:
        """True if the plan has edits that were not uploaded."""
        return self.is_edited and parts_of(self.plan) != parts_of(self.source)

    def followed(self, vehicle: Plan, system_id: int | None) -> MissionDraft:
        """Return the draft after the plan of this vehicle was read: that plan, unless the draft is changed."""
        if vehicle is self.source:
            return self
        if self.is_changed:
            return self._replace(source=vehicle)
        return MissionDraft(vehicle, vehicle, system_id=system_id)

    def edited(self, items: Items) -> MissionDraft:
        """Return the draft with other mission items."""
        return self.loaded(replace(self.plan, items=items))

    def loaded(self, plan: Plan) -> MissionDraft:
        """Return the draft with another plan."""
        return self._replace(plan=plan, past=(*self.past[-_UNDO_STEPS:], self.plan), is_edited=True)

    def undone(self) -> MissionDraft:
        """Return the draft before the last edit."""
        return self._replace(plan=self.past[-1], past=self.past[:-1]) if self.past else self

    def uploaded(self, system_id: int | None) -> MissionDraft:
        """Return the draft after this vehicle accepted it."""
        return self._replace(is_edited=False, past=(), system_id=system_id)

    def to_upload(self) -> Plan:
        """Return the plan without the geofence and rally points that the vehicle has already."""
        plan, source = self.plan, self.source
        return replace(
            plan,
            fence=() if plan.fence == source.fence else plan.fence,
            rally=() if plan.rally == source.rally else plan.rally,
        )


def parts_of(plan: Plan) -> tuple[Items, Items, Items]:
    """Return mission, geofence and rally points."""
    return plan.items, plan.fence, plan.rally
