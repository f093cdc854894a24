"""Ideal readings, error models, named devices, and suites of sensors at their sites."""
