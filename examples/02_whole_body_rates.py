"""Move the whole body at once with Davies' method: no support leg, no five Jacobians.

The waist circles while both feet stay on the floor and the hands keep their places. One network matrix gives
all joint rates. Then the choice of primary couplings is turned round: the right leg's joints are imposed, and
the waist follows.
"""

import numpy as np

import screwkin as sk
from screwkin.mechanism.closure import close_loops


def main() -> float:
    """Print joint rates, check them against positions solved a moment later, and return the largest error."""
    robot = sk.load_robot("bioloid")
    mechanism = sk.closed_mechanism(robot)
    home = sk.home(robot)
    print(
        f"{robot.name}: {len(mechanism.couplings)} couplings, {len(mechanism.links)} links, "
        f"{len(mechanism.circuits)} circuits, mobility {mechanism.mobility}"
    )

    twist = np.array([0.0, 0.0, 0.3, 0.02, -0.03, 0.01])  # turn, and drift forward, right and up
    still = {tip: np.zeros(6 if "foot" in tip else 3) for tip in robot.tip_names}
    imposed = sk.virtual_motion(mechanism, home, twist, still)
    rates = dict(zip(mechanism.secondary, sk.secondary_rates(mechanism, home, imposed), strict=True))
    for name in robot.joint_names[:6]:
        print(f"  {name:<20} {np.degrees(rates[name]):8.2f} deg/s")

    # The same motion by positions: all tips held, the waist a little before and after.
    h = 1e-5
    targets = {tip: sk.frame_pose(robot, home, tip) for tip in robot.tip_names}
    targets |= {tip: T[:3, 3] for tip, T in targets.items() if "hand" in tip}
    sides = []
    for t in (-h, h):
        base = home.T_world_base.copy()
        base[:3, 3] += t * twist[3:]
        c, s = np.cos(t * twist[2]), np.sin(t * twist[2])
        base[:3, :3] = [[c, -s, 0], [s, c, 0], [0, 0, 1]]
        sides.append(sk.solve_pose(robot, {"base": base, **targets}).state.q)
    slope = (sides[1] - sides[0]) / (2 * h)
    error = float(max(abs(slope[i] - rates[name]) for i, name in enumerate(robot.joint_names)))
    print(f"rates against positions differenced: {error:.1e} rad/s")

    legs = [name for name in robot.joint_names if name.startswith("right_") and "ank" not in name][:4]
    hands = [name for name in mechanism.primary if "hand" in name]
    feet = [name for name in mechanism.couplings if "foot" in name]
    ankle = ["right_ankle_pitch", "right_ankle_roll"]
    turned = sk.closed_mechanism(robot, primary=[*legs, *ankle, *feet, *hands])
    bent = close_loops(turned, home, {"right_knee": home.q[3] + np.radians(np.linspace(0, 5, 6))})
    sink = 1e3 * (bent.state.T_world_base[:, 2, 3] - home.T_world_base[2, 3])
    print(f"right knee imposed, waist follows by {sink[-1]:.1f} mm, residual {bent.residual.max():.0e}")
    return error


if __name__ == "__main__":
    main()
