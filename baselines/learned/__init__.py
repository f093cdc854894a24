"""Learned estimators: features, networks, training and running them."""
