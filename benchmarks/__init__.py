"""Speeds beside their floors: ``python -m benchmarks``; docs/explanation/performance.md says how to read them."""
