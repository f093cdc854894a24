"""The force and inertial sensor study."""
