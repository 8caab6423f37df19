"""State estimation: an error-state Kalman filter with delayed measurements and an output predictor. Pure, compiled."""
