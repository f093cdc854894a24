"""Gains that a policy sets, the innovation features that it observes, and the filter that combines both."""
