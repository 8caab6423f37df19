"""The screens Messages and Inspector: texts and MAVLink messages of the vehicle."""
