"""Rotations, quantities, the estimator protocol, the Kalman recursion and the metrics: the basis of every filter."""
