"""Tables of numbers, whatever file they come from: cells, names, units, stamps, rows of several sensors."""
