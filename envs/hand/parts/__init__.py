"""Parts of a motion that lie over a gesture: tremor, taps, vibration, drift, soft tissue, gait."""
