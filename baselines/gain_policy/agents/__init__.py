"""Further agents of stable-baselines3 and sb3-contrib that tune filters, and what all agents share."""
