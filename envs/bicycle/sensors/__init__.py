"""The published sensor suites on rider and bicycle."""
