"""The accelerometer-array study."""
