"""Steps per second of filters and environments."""
