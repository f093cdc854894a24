"""Samples as they arrive, and motion as it is seen: ``poise stream`` and ``poise view``."""
