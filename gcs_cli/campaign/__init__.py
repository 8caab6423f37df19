"""Campaigns: many flights of one scenario with varied inputs: plan, table, report, and search for the worst."""
