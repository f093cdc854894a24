"""The bicycle: frame, wheels, tyres, drivetrain and the linear Whipple–Carvallo model."""
