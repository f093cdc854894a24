"""Domain randomisation: recipes from which training and test episodes are drawn, and rebuilt bit for bit."""
