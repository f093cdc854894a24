"""Trunk, arms and legs of a rider from six gyroscopes and kinematic constraints."""
