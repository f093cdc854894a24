"""Published filters for a rider on a bicycle, and the geometry that they are configured with."""
