"""Learned estimators of riders beside the papers' filters and beside what a network should beat."""
