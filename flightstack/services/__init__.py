"""The vehicle's side of its ground links, without I/O: peers, services, telemetry."""
