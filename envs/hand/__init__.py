"""A hand that moves a device: gestures, drivers, device noise models, the environment."""
