"""The ground floor: rotations, quantities, the Kalman core, published filters, metrics. Needs no simulator."""
