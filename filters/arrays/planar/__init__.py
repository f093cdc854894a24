"""Orientation in a vertical plane from accelerometers and one gyroscope."""
