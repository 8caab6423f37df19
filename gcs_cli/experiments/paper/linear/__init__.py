"""Linear analysis of the paper's loops: poles, margins, lowest rates and step responses, checked by simulation.

``gains`` sorts the loops' own parameters by axis; ``continuous`` and ``sampled`` are the loops in s and tick by tick;
``margins`` and ``steps`` derive figures from them. These are pure. ``small_signal`` flies the real loops with signals
so small that they are linear, ``onset`` finds the lowest stable rates, and ``tables`` gathers the results.
"""

from gcs_cli.experiments.paper.linear.tables import onset, results

__all__ = ["onset", "results"]
