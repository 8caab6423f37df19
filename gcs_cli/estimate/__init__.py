"""The estimator on the sensors of a log: samples, differences to other estimates and to truth, report."""
