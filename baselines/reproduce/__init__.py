"""The tables and figures of the published works, beside what this package gets."""
