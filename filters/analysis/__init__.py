"""What a model can achieve: posterior bounds, observability, exact derivatives."""
