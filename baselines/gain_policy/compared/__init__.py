"""Policies beside what they should beat: other tunings, bounds, several trainings; and what a policy does."""
