"""Generate C99 from control laws: compiled functions over floats, NamedTuples of floats and small arrays."""
