"""A smooth waist path: how the gait ``smooth`` was made.

Key points leave the waist's path to a spline, and the ZMP swings far from the projected centre of mass. Here
the path is free: a few harmonics for the steady walk and B-splines over the first and the last 0.8 step. Both
CoM and ZMP, from the dynamics of all links, are nearly linear in the coefficients, so that a few linear
programs find the path with the least of the largest |GCoM - ZMP|, under a floor for the ZMP's margin.

Footholds, period, waist height and swings stay as they are. The table printed at the end is the one in
``trajectories/smooth.toml``, up to what another version of the solver changes in the last digits.
"""

import math

import screwkin as sk
from screwkin.gait.optimise import Iterate, optimise_waist, waist_table

MARGIN = 0.0155  # m: floor of the search; half a millimetre more costs about 0.23 mm of |GCoM - ZMP|
BEND = math.radians(30)  # of the knees, at least


def show(name: str, robot: sk.Robot, gait: sk.Gait, steps: int = 8) -> float:
    """Print the balance of a gait and return its largest |GCoM - ZMP| [mm]."""
    trajectory = sk.walk(robot, gait.replace(rate=200), steps=steps)
    balance = sk.zmp(robot, trajectory)
    largest, margin = 1e3 * balance.distance.max(), 1e3 * balance.margin.min()
    knees = [i for i, joint in enumerate(trajectory.joint_names) if joint.endswith("knee")]
    bend = math.degrees(trajectory.q[:, knees].min())
    print(f"{name:10} |GCoM - ZMP| {largest:5.2f} mm, margin {margin:5.2f} mm, knees {bend:4.1f} deg")
    return float(largest)


def told(step: Iterate) -> None:
    missed = f", bounds missed by {1e3 * step.violation:.2f} mm" if step.violation else ""
    print(f"  program {step.iteration + 1}: {1e3 * step.distance:.2f} mm{missed}", flush=True)


def main(margin: float = MARGIN, iterations: int = 8) -> float:
    """Rerun the optimisation, print before and after; return how many times smaller the distance became."""
    robot = sk.load_robot("bioloid")
    before = show("paper", robot, sk.load_gait("paper"))
    start = sk.load_gait("walk").replace(Tc=1.0, rate=100)
    knees = {"right_knee": BEND, "left_knee": BEND}
    gait = optimise_waist(robot, start, margin=margin, least=knees, iterations=iterations, report=told)
    after = show("optimised", robot, gait)
    show("stored", robot, sk.load_gait("smooth"))
    print(waist_table(gait))
    print(f"The largest |GCoM - ZMP| of a walk of 8 steps is {before / after:.1f} times smaller.")
    return before / after


if __name__ == "__main__":
    main()
