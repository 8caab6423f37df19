"""MAVLink services as state machines without I/O: receive, poll, next_deadline, events."""
