"""The two-gyroscope study."""
