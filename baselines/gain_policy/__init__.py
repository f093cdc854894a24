"""Policies that adapt filter gains: training, constant-gain references and running them."""
