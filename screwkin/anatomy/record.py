"""What anatomy reads off a robot: every answer with a confidence in [0, 1] and a sentence why."""

from __future__ import annotations

from dataclasses import dataclass

from screwkin.algebra.se3 import Rotation
from screwkin.model.robot import Robot


@dataclass(frozen=True)
class Finding:
    """One answer: what it is about, what it is, how sure it is, from 0 to 1, and why."""

    about: str
    answer: str
    confidence: float
    why: str

    def __str__(self) -> str:
        return f"{self.about}: {self.answer}. Confidence {self.confidence:.2f}: {self.why}."


@dataclass(frozen=True, eq=False)
class Anatomy:
    """A humanoid with its limbs, soles and home.

    Attributes:
        robot: with limbs ``right_leg left_leg right_arm left_arm``, tips, soles, ``home``; x forward, z up.
        turn: takes vectors of the base axes as they were to those of ``robot``; unity if they stand as usual.
        limbs: findings by the name of the limb: its links and joints.
        soles: findings by the name of the leg.
        symmetry: the plane of symmetry.
        forward: which way is forward.
        waist: the frame that gaits steer, and the joints between legs and arms.
        home: the posture.
        remarks: what could not be read, and what a user should look at.
    """

    robot: Robot
    turn: Rotation
    symmetry: Finding
    forward: Finding
    limbs: tuple[Finding, ...]
    soles: tuple[Finding, ...]
    waist: Finding
    home: Finding
    remarks: tuple[str, ...]

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings."""
        return (self.symmetry, self.forward, *self.limbs, *self.soles, self.waist, self.home)

    @property
    def confidence(self) -> float:
        """The least confidence of all findings: a robot is as sure as its least sure part."""
        return min(finding.confidence for finding in self.findings)
