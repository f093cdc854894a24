"""Estimation of scale, offset and axes from rate-table and tumbling runs."""
