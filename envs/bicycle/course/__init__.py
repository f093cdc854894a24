"""Where a ride goes: paths, terrain, scenarios and the drawn scene."""
