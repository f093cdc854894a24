"""Orientation in space from an accelerometer array and a magnetometer; the virtual controller."""
