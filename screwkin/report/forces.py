"""Pictures of forces: forces of the feet, where in the soles, and what the joints do."""

from __future__ import annotations

from screwkin.analysis.contact_account import ForceAccount
from screwkin.dynamics.support import sole_corners
from screwkin.report.motion import joints_shown
from screwkin.report.style import (
    LINES,
    MEASURED,
    PLAIN,
    Figure,
    finished,
    foot_colours,
    shown,
    time_figure,
)

_AXES = ("x", "y")


def foot_forces(forces: ForceAccount) -> Figure:
    """The floor's force on every foot against time, planned and simulated."""
    account, time = forces.account, forces.account.trajectory.time
    figure, _ = time_figure(account, 0.9 + 2.0 * len(forces.feet), len(forces.feet), sharey=True)
    for k, (foot, one) in enumerate(zip(forces.feet, figure.axes, strict=True)):
        seen = forces.simulated
        if seen is not None:
            one.plot(
                seen.time,
                seen.foot_force[:, k, 2],
                color=MEASURED,
                linewidth=2.6,
                alpha=0.55,
                label="z, simulated",
            )
            one.plot(seen.time, seen.foot_force[:, k, 0], color=MEASURED, linewidth=0.8, label="x, simulated")
        force = forces.forces.wrenches[:, k, 3:]
        one.plot(
            time, force[:, 2], color=foot_colours(account)[foot], linewidth=1.3, label=f"z of {shown(foot)}"
        )
        one.plot(time, force[:, 0], color="#222222", linewidth=0.9, label="x")
        one.plot(time, force[:, 1], color="#222222", linewidth=0.9, linestyle=":", label="y")
        one.set_ylabel(f"force on {shown(foot)} [N]")
    return finished(figure, account, columns=5)


def pressure(forces: ForceAccount) -> Figure:
    """Centre of pressure in the frame of every foot, and the borders of its sole."""
    account, time = forces.account, forces.account.trajectory.time
    figure, _ = time_figure(account, 4.6, 2)
    for axis, one in enumerate(figure.axes):
        for k, (foot, colour) in enumerate(foot_colours(account).items()):
            corners = 1e3 * sole_corners(account.robot, foot)[:, axis]
            for border in (corners.min(), corners.max()):
                one.axhline(border, color=colour, linewidth=0.8, linestyle=LINES[1 + k % 2])
            one.plot(time, 1e3 * forces.pressure[:, k, axis], color=colour, label=shown(foot))
        one.plot([], [], color=PLAIN, linewidth=0.8, linestyle="--", label="borders of the soles")
        one.set_ylabel(f"{_AXES[axis]} of the pressure [mm]")
    return finished(figure, account, columns=5)


def joint_efforts(forces: ForceAccount, kind: str = "leg") -> Figure | None:
    """Efforts of the joints of all legs (or arms), planned and simulated; None without such limbs."""
    account = forces.account
    robot, time = account.robot, account.trajectory.time
    limbs = [limb for limb in robot.limbs if limb.kind == kind]
    if not limbs:
        return None
    figure, _ = time_figure(account, 1.2 + 2.3 * len(limbs), len(limbs), sharey=True)
    for limb, one in zip(limbs, figure.axes, strict=True):
        for i, name, colour in joints_shown(robot, limb):
            seen = forces.simulated
            if seen is not None:
                one.plot(seen.time, seen.torque[:, i], color=colour, linewidth=2.8, alpha=0.3)
            one.plot(time, forces.forces.efforts[:, i], color=colour, linewidth=1.1, label=name)
        if forces.simulated is not None:
            one.plot([], [], color=PLAIN, linewidth=2.8, alpha=0.3, label="simulated")
        one.set_ylabel(f"{shown(limb.name)} [N m]")
    return finished(figure, account, columns=4)
