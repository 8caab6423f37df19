"""The flight stack process: options, files, clock, and the parts joined and run."""
