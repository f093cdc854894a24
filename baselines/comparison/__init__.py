"""The standard comparison: tasks, measures beyond RMS errors, intervals, regressions, the report for a browser."""
