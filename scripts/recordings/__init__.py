"""Commands on recordings: look at them, estimate, compare estimators, choose one."""
