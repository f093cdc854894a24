"""The external-acceleration study."""
