"""Numbers that decide a flight: vehicles, gains, behaviour."""
