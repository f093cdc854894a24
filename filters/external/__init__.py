"""Estimators of other packages (vqf, imufusion, ahrs) with the interface of this one."""
