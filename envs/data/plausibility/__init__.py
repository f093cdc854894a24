"""Plausibility of recordings: clocks, units, signs, axes, and sensors that contradict one another."""
