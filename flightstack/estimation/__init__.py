"""State estimation. Pure. Planned: the interface ``StateEstimator`` and an EKF on simulated sensors.

The package is empty so far: the control loops, guidance and commander use the true state that the simulator sends.
"""
