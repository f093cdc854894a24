"""Calibration records, and the runs that they are estimated from."""
