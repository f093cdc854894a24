"""Learned estimators, gain policies, the registry of all estimators, evaluation and plots."""
