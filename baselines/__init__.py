"""Estimators to compare: learned ones, policies that adapt gains, the list of all by name, evaluation and plots."""
