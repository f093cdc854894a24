"""Chain and freewheel between crank and rear wheel."""

from __future__ import annotations

from .parameters import DriveParameters


class Drivetrain:
    """A chain as a one-way torsional spring with damping: it pulls, and slips freely when the wheel overtakes.

    The torque follows from the twist between the crank (times the ratio) and the wheel. The torques on crank and wheel,
    with their reactions on the frame, are what a chain's tension does when it is tangent to both sprockets.

    Args:
        parameters: ratio, stiffness and damping.
    """

    def __init__(self, parameters: DriveParameters) -> None:
        self.parameters = parameters
        self.slipped = 0.0
        """rad: angle by which the wheel has run ahead"""

    def engage(self, crank: float, wheel: float) -> None:
        """Begin with the chain just taut, at these angles (rad)."""
        self.slipped = self.parameters.ratio * crank - wheel

    def torque(self, crank: float, crank_rate: float, wheel: float, wheel_rate: float) -> float:
        """Torque on the rear wheel (N·m, not negative); the crank feels −ratio times it. Call once a step.

        Args:
            crank: angle, rad, growing when pedalling forward.
            crank_rate: rad/s.
            wheel: angle, rad, growing when rolling forward.
            wheel_rate: rad/s.
        """
        drive = self.parameters
        twist = drive.ratio * crank - wheel - self.slipped
        if twist <= 0.0:
            self.slipped += twist
            return 0.0
        rate = drive.ratio * crank_rate - wheel_rate
        return max(0.0, drive.chain_stiffness * twist + drive.chain_damping * rate)
