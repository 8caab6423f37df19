"""Actions: what a user asks of a vehicle, done when the vehicle reports the effect. Pure and sans-IO."""
