"""Networks: in NumPy to run, in torch to train."""
