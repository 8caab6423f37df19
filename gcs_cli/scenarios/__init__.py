"""Scenario files in parallel: select, fly, show and report them."""
