"""Ride summary statistics and mechanical checks of simulated rides."""
