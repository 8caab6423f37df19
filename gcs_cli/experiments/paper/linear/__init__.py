"""Linear analysis of the paper's loops: poles, margins, lowest rates and step responses, and what simulation says.

``gains`` sorts the loops' own parameters by axis; ``continuous`` and ``sampled`` are the loops, once in s and once as
they are computed, tick by tick; ``margins`` and ``steps`` read figures from them. All that is pure. ``small_signal``
flies the real loops so little that they are linear, ``instability`` seeks by that the rate at which instability sets
in, and ``tables`` gathers everything for the report.
"""

from gcs_cli.experiments.paper.linear.tables import onset, results

__all__ = ["onset", "results"]
