"""Gains that a policy may set, the innovation features that it sees, and the filter around it."""
