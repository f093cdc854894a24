"""Trajectories: the record of an episode or a recording, its files, other rates, formats, calibration."""
