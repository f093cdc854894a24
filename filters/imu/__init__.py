"""Filters of a single inertial sensor, with and without a magnetometer."""
