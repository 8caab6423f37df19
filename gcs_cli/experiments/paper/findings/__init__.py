"""Findings from the flights: comparisons, verdicts, and the printed values of the paper."""
