"""The screen Map: plan, track and vehicles from above."""
