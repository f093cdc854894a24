"""How true the simulators are: statistics of simulated episodes beside those of recordings and publications."""
