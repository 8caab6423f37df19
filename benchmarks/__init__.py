"""Speeds beside their floors: ``python -m benchmarks``; docs/performance.md says how to read them."""
