"""From a model written once over arrays to a compiled loop over time: record, print, compile, run."""
