"""Perturbations drawn from a seed: how far each figure may lie from the plan, and one world out of that."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from screwkin.errors import InputError
from screwkin.model.robot import Robot
from screwkin.sim.perturbation import Perturbation


@dataclass(frozen=True)
class Spread:
    """Ranges from which worlds are drawn, each evenly; the defaults are those of a desktop humanoid of 2 kg.

    mass, inertia: factors within 1 +- this, of every link; com: shift of the base link's CoM along x and y,
    within +- this [m]; payload: up to this [kg]; friction: least and greatest coefficient; restitution: up
    to this; slope: up to this [rad], in any direction; rise: within +- this [m], anywhere on the way; push:
    least and greatest impulse [N s], at any time in any level direction; lag: up to this [s], one for all
    servos, or one for each if each_lag; stiffness, torque: least factor, 1 the greatest; backlash: up to this
    [rad]; fade: up to this [1/s]; dropped: up to this share; imu_noise [rad], imu_rate_noise [rad/s]: up to
    this; imu_bias [rad], imu_rate_bias [rad/s]: about each axis within +- this; sense_lag: up to this [s].
    """

    mass: float = 0.1
    inertia: float = 0.0
    com: float = 0.008
    payload: float = 0.0
    friction: tuple[float, float] = (0.4, 1.0)
    restitution: float = 0.0
    slope: float = math.radians(1.5)
    rise: float = 0.0
    push: tuple[float, float] = (0.05, 0.15)
    lag: float = 0.02
    each_lag: bool = False
    stiffness: float = 0.6
    torque: float = 2.0 / 3.0
    backlash: float = 0.0
    fade: float = 0.0
    dropped: float = 0.0
    imu_noise: float = 0.0
    imu_rate_noise: float = 0.0
    imu_bias: float = 0.0
    imu_rate_bias: float = 0.0
    sense_lag: float = 0.0

    def scaled(self, by: float) -> Spread:
        """So many times as far from the plan; friction, stiffness, torque and shares stay as they are."""
        if not (math.isfinite(by) and by >= 0):
            raise InputError(f"a spread scaled by {by!r}; give a finite number of at least 0")
        low, high = self.push
        return replace(self, push=(by * low, by * high), **{key: by * getattr(self, key) for key in _SCALED})

    def only(self, *keys: str) -> Spread:
        """Nothing but these keys differs from the plan.

        Raises:
            InputError: a key is none of a spread.
        """
        unknown = [key for key in keys if key not in vars(NOWHERE)]
        if unknown:
            raise InputError(f"{', '.join(unknown)}: no key of a spread; valid: {', '.join(vars(NOWHERE))}")
        return replace(NOWHERE, **{key: getattr(self, key) for key in keys})


_SCALED = (
    *("mass", "inertia", "com", "payload", "slope", "rise", "lag", "backlash"),
    *("imu_noise", "imu_rate_noise", "imu_bias", "imu_rate_bias", "sense_lag"),
)
NOWHERE = Spread(
    mass=0.0, com=0.0, friction=(1.0, 1.0), slope=0.0, push=(0.0, 0.0), lag=0.0, stiffness=1.0, torque=1.0
)
"""Nothing differs from the plan."""
_LIGHTEST = 0.05  # least factor of a mass, however far it is scaled


def drawn_world(
    robot: Robot, seed: int, spread: Spread, duration: float, distance: float = 0.0
) -> Perturbation:
    """The world of a seed.

    Every figure has a stream of its own, so that one does not depend on which others may differ.

    Args:
        robot: its links and joints.
        seed: at least 0; it is the perturbation's seed too.
        spread: how far from the plan.
        duration: of the trajectory [s], in which the push comes.
        distance: along x [m], on which the rise lies.

    Example:
        >>> import screwkin as sk
        >>> from screwkin.sim.drawn import Spread, drawn_world
        >>> robot = sk.load_robot(sk.robot_names()[0])
        >>> drawn_world(robot, 3, Spread().only("friction"), 5.0).to_dict().keys()
        dict_keys(['friction', 'seed'])
    """

    def stream(key: str) -> np.random.Generator:
        return np.random.default_rng([seed, *key.encode()])

    def within(key: str, count: int = 1) -> list[float]:
        far = getattr(spread, key)
        values: list[float] = stream(key).uniform(-far, far, count).tolist()
        return values

    def between(key: str, low: float, high: float, count: int = 1) -> list[float]:
        values: list[float] = stream(key).uniform(low, high, count).tolist()
        return values

    def up_to(key: str) -> float:
        return between(key, 0.0, getattr(spread, key))[0]

    steep, way = up_to("slope"), between("slope way", 0.0, 2 * math.pi)[0]
    (impulse,), (towards,) = between("push", *spread.push), between("push way", 0.0, 2 * math.pi)
    factors = [max(_LIGHTEST, 1.0 + far) for far in within("mass", len(robot.links))]
    lags = between("lag", 0.0, spread.lag, len(robot.joints) if spread.each_lag else 1)
    aside, bias, rate_bias = within("com", 2), within("imu_bias", 3), within("imu_rate_bias", 3)
    return Perturbation(
        mass=dict(zip(robot.link_names, factors, strict=True)) if spread.mass else 1.0,
        inertia=max(_LIGHTEST, 1.0 + within("inertia")[0]),
        com=(aside[0], aside[1], 0.0),
        payload=up_to("payload"),
        friction=None if spread.friction == NOWHERE.friction else between("friction", *spread.friction)[0],
        restitution=up_to("restitution"),
        slope=(steep * math.cos(way), steep * math.sin(way)),
        rise=within("rise")[0],
        rise_at=between("rise at", 0.0, distance)[0] if spread.rise else 0.0,
        push=(impulse * math.cos(towards), impulse * math.sin(towards), 0.0),
        push_at=between("push at", 0.0, duration)[0] if any(spread.push) else 0.0,
        lag=dict(zip(robot.joint_names, lags, strict=True)) if spread.each_lag and spread.lag else lags[0],
        stiffness=between("stiffness", spread.stiffness, 1.0)[0],
        torque=between("torque", spread.torque, 1.0)[0],
        backlash=up_to("backlash"),
        fade=up_to("fade"),
        dropped=up_to("dropped"),
        imu_noise=up_to("imu_noise"),
        imu_rate_noise=up_to("imu_rate_noise"),
        imu_bias=(bias[0], bias[1], bias[2]),
        imu_rate_bias=(rate_bias[0], rate_bias[1], rate_bias[2]),
        sense_lag=up_to("sense_lag"),
        seed=seed,
    )
