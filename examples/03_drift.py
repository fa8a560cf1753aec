"""Why positions come from the loops and not from integrated rates.

Davies' method gives rates. Integrated over four steps of the paper's gait they drift, and the loops open: by
centimetres with Euler's method, far less with Runge-Kutta. Newton's method on the loops has no memory.
"""

from collections.abc import Callable

import numpy as np

import screwkin as sk
from screwkin.gait.plan import plan
from screwkin.gait.stance import stance_of

STEP = 0.02  # integration step [s]


Rates = Callable[[float, np.ndarray], np.ndarray]


def runge_kutta(rates: Rates) -> Rates:
    """The mean rate over a step, by the classical method of order four."""

    def mean(t: float, q: np.ndarray) -> np.ndarray:
        first = rates(t, q)
        second = rates(t + STEP / 2, q + STEP / 2 * first)
        third = rates(t + STEP / 2, q + STEP / 2 * second)
        fourth = rates(t + STEP, q + STEP * third)
        return np.asarray((first + 2 * second + 2 * third + fourth) / 6)

    return mean


def main() -> dict[str, float]:
    """Print and return the largest error of the feet [m] by method."""
    robot = sk.load_robot("bioloid")
    mechanism = sk.closed_mechanism(robot)
    gait = sk.load_gait("paper").replace(rate=2 / STEP)  # also the middle of each step, for Runge-Kutta
    made = plan(gait, stance_of(robot), 4)
    walked = sk.walk(robot, gait, steps=4)
    joints = [mechanism.secondary.index(name) for name in robot.joint_names]

    def rates(t: float, q: np.ndarray) -> np.ndarray:
        """Joint rates at time t from the network matrix at the drifted positions q."""
        k = round(t / made.duration * (len(made.time) - 1))
        state = sk.State(made.T_world_base[k], q)
        tips = {name: twist[k] for name, twist in made.tip_twist.items()}
        tips |= {name: velocity[k] for name, velocity in made.hand_velocity.items()}
        imposed = sk.virtual_motion(mechanism, state, made.base_twist[k], tips)
        return np.asarray(sk.secondary_rates(mechanism, state, imposed))[joints]

    def opening(q: np.ndarray, samples: slice) -> float:
        """Largest distance between the feet that joints give and those that were planned [m]."""
        state = sk.State(made.T_world_base[samples], q)
        return max(
            float(np.abs(sk.frame_pose(robot, state, foot)[:, :3, 3] - T[samples, :3, 3]).max())
            for foot, T in made.T_world_tip.items()
        )

    errors = {"newton": opening(walked.q, slice(None))}
    coarse = slice(None, None, 2)
    for name, slope in (("euler", rates), ("rk4", runge_kutta(rates))):
        q = [walked.q[0]]
        for t in made.time[coarse][:-1]:
            q.append(q[-1] + STEP * slope(t, q[-1]))
        errors[name] = opening(np.array(q), coarse)
    for method, error in errors.items():
        print(f"{method:>7}: feet off by {error:.1e} m after {made.duration:.0f} s")
    return errors


if __name__ == "__main__":
    main()
