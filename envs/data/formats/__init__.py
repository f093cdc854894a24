"""Readers of recordings, one file format a module; the format is recognised by the content."""
