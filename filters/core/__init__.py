"""Rotations, quantities, the estimator protocol, the Kalman recursion and the metrics: what every filter stands on."""
