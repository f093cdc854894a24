"""The whole-body study."""
