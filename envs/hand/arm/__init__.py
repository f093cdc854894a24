"""A device pulled by an arm of finite stiffness: the dynamic drive of hand motion."""
