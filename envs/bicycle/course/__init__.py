"""Courses of rides: paths, terrain, scenarios and the rendered scene."""
