"""Walk: from a gait file to a ZMP on paper, then the same ZMP from contact forces in simulation."""

import numpy as np

import screwkin as sk


def main(steps: int = 4) -> float:
    """Walk, predict, simulate; print the verdict and return the largest ZMP error [mm]."""
    robot = sk.load_robot("bioloid")
    gait = sk.load_gait("walk").replace(Tc=1.0)
    walk = sk.walk(robot, gait, steps=steps)

    balance = sk.zmp(robot, walk)
    print(f"{steps} steps in {walk.duration:.1f} s, ZMP margin at least {1e3 * balance.margin.min():.1f} mm")
    off = 1e3 * np.linalg.norm(balance.zmp - balance.cart_table, axis=1).max()
    print(f"a cart-table would misplace the ZMP by up to {off:.1f} mm")

    verdict = sk.validate(robot, walk, servo="rigid")  # the servos of its table follow less exactly
    print(f"{verdict.engine}: {'passed' if verdict.passed else 'failed: ' + '; '.join(verdict.reasons)}")
    result = verdict.to_dict()
    print(f"ZMP from contact forces against the plan: {result['zmp_max_mm']} mm at most")
    return float(np.max(result["zmp_max_mm"]))


if __name__ == "__main__":
    main()
