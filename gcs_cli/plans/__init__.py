"""Plans on the ground: patterns, editing, comparison, formats of other programs, and drawings."""
