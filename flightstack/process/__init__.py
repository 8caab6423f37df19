"""The flight stack process: options, files, clock, assembly and main loop."""
