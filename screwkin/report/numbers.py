"""The numbers of an account: as JSON data, and as rows of name, value, unit and remark."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from screwkin.analysis.account import Account

if TYPE_CHECKING:  # it brings the simulator, which a walk does without
    from screwkin.analysis.validate import Validation


class Number(NamedTuple):
    """One line of a table of numbers."""

    name: str
    value: str
    remark: str = ""


def balance_data(account: Account) -> dict[str, Any]:
    """ZMP, margin and spikes as JSON data."""
    balance = account.balance
    return {
        "min_margin_mm": 1e3 * float(balance.margin.min()),
        "max_gcom_zmp_mm": 1e3 * float(balance.distance.max()),
        "max_cart_table_zmp_mm": 1e3 * float(_gap(balance.cart_table, balance.zmp).max()),
        "outside_fraction": float(account.outside.mean()),
        "spikes": [{"time": s.time, "distance_mm": 1e3 * s.distance} for s in balance.spikes],
    }


def walk_data(account: Account) -> dict[str, Any]:
    """The numbers that ``walk`` reports of a trajectory, as JSON data."""
    trajectory = account.trajectory
    return {
        "robot": account.robot.name,
        "samples": trajectory.samples,
        "duration": trajectory.duration,
        "steps": account.steps,
        **balance_data(account),
        "max_closure": account.max_closure,
        "closure": {tip: {"m": gap, "rad": angle} for tip, (gap, angle) in account.closure.items()},
        "singular": account.singular_samples,
        "limbs": {
            limb.limb: {"sigma": limb.sigma, "near": limb.near, "cause": limb.cause} for limb in account.limbs
        },
        "servos": {name: asdict(share) for name, share in account.servos.items()},
        "self_collisions": None if account.collisions is None else [c.to_dict() for c in account.collisions],
        "warnings": list(account.warnings),
        "trajectory_sha256": trajectory.sha256,
    }


def balance_numbers(account: Account) -> list[Number]:
    """ZMP, margin and spikes."""
    balance, time = account.balance, account.trajectory.time
    low, far = int(balance.margin.argmin()), int(balance.distance.argmax())
    outside = 100 * float(account.outside.mean())
    return [
        Number("smallest margin of the ZMP", _mm(balance.margin[low]), f"at {time[low]:.2f} s"),
        Number("samples with the ZMP outside", f"{outside:.1f} %", "would tip over" if outside else ""),
        Number("largest |GCoM - ZMP|", _mm(balance.distance[far]), f"at {time[far]:.2f} s"),
        Number(
            "cart-table ZMP against this one", _mm(_gap(balance.cart_table, balance.zmp).max()), "largest"
        ),
        Number("spikes of |GCoM - ZMP|", str(len(balance.spikes)), _times(account)),
    ]


def walk_numbers(account: Account) -> list[Number]:
    """The numbers that ``walk`` reports of a trajectory."""
    trajectory = account.trajectory
    steps = "" if account.steps is None else f"{account.steps} steps"
    rows = [
        Number(
            "duration", f"{trajectory.duration:.2f} s", f"{trajectory.samples} samples; {steps}".strip("; ")
        ),
        *balance_numbers(account),
        Number("closure of the loops", f"{account.max_closure:.1e}", "m and rad, largest"),
        Number("singular samples", str(account.singular_samples)),
    ]
    if account.limbs:
        limb = min(account.limbs, key=lambda limb: limb.sigma)
        at = f"{limb.limb} at {trajectory.time[limb.sample]:.2f} s; below 0.02 is near singular"
        rows.append(Number("least singular value", f"{limb.sigma:.3f}", at))
    pairs = None if account.collisions is None else {one.collision.links for one in account.collisions}
    if pairs is None:
        rows.append(Number("links that collide", "unknown", "MuJoCo is not installed"))
    elif pairs:
        rows.append(Number("links that collide", str(len(pairs)), "pairs; see the warnings"))
    return rows + _servo_numbers(account)


def _servo_numbers(account: Account) -> list[Number]:
    """How near the plan takes servos to their speed, their torque and the line between these."""
    rows = []
    for what, key in (("fastest joint", "speed"), ("strongest joint", "torque"), ("nearest to both", "line")):
        shares = {name: getattr(share, key) or 0.0 for name, share in account.servos.items()}
        name = max(shares, key=lambda name: shares[name])
        if shares[name] > 0:
            of = "of its speed-torque line" if key == "line" else "of its limit"
            when = f" at {account.servos[name].at:.2f} s" if key == "line" else ""
            rows.append(Number(what, f"{100 * shares[name]:.0f} %", f"{of}: {name}{when}"))
    if rows and all(share.torque is None for share in account.servos.values()):
        rows.append(Number("torques", "unknown", "they do not follow from the motion alone"))
    return rows


def validation_numbers(check: Validation) -> list[Number]:
    """The numbers of a simulation."""
    rows = [
        Number("engine", check.engine),
        Number("fell", "no" if check.fell_at is None else f"at {check.fell_at:.2f} s"),
        Number("distance", f"{check.distance:.3f} m", f"planned {check.planned_distance:.3f} m"),
        Number("error at the end", f"{check.end_error_mm:.2f} mm", f"heading {check.end_turn_deg:.2f} deg"),
        Number("largest slip of a bearing sole", f"{check.slip_mm:.2f} mm"),
        Number("largest tilt", f"{check.max_tilt_deg:.2f} deg"),
    ]
    if check.zmp_rms_xy_mm is not None and check.zmp_max_xy_mm is not None:
        (x, y), (most_x, most_y) = check.zmp_rms_xy_mm, check.zmp_max_xy_mm
        rows.append(Number("contact ZMP against plan, RMS", f"{x:.2f} / {y:.2f} mm", "x / y, 50 ms mean"))
        rows.append(Number("contact ZMP against plan, largest", f"{most_x:.2f} / {most_y:.2f} mm", "x / y"))
    if check.torque_use:
        name = max(check.torque_use, key=lambda joint: check.torque_use[joint])
        rows.append(
            Number("largest torque", f"{100 * check.torque_use[name]:.0f} %", f"of its limit: {name}")
        )
    if check.joint_stiffness is not None:
        k = sorted(set(check.joint_stiffness.values()))
        values = f"{k[0]:.4g}" if len(k) == 1 else f"{k[0]:.4g} to {k[-1]:.4g}"
        rows.append(
            Number(
                "elastic servos", f"{values} N m/rad", f"compensation in the commands: {check.compensation}"
            )
        )
    if check.sole_stiffness is not None:
        rows.append(Number("elastic soles", f"{check.sole_stiffness:g} N/m", "at every point of contact"))
    return rows + _repetitions(check)


def _repetitions(check: Validation) -> list[Number]:
    """The numbers of runs under other frictions and time steps."""
    row = check.study
    if row is None:
        return []
    fell = Number("repeated runs", str(row.runs), f"{row.fallen} fell")
    if row.median_mm is None or row.range_mm is None:
        return [fell]
    (x, y), ((x0, x1), (y0, y1)) = row.median_mm, row.range_mm
    span = f"x {x0:.1f} to {x1:.1f}, y {y0:.1f} to {y1:.1f} mm, of those that did not fall"
    return [fell, Number("their largest ZMP errors, median", f"{x:.1f} / {y:.1f} mm", span)]


def _gap(a: Any, b: Any) -> Any:
    return np.linalg.norm(a - b, axis=1)


def _mm(value: float) -> str:
    return f"{1e3 * value:.1f} mm"


def _times(account: Account, most: int = 12) -> str:
    """When the spikes are, phase within a step where the steps are known."""
    spikes = account.balance.spikes
    if not spikes:
        return ""
    times = ", ".join(f"{spike.time:.2f}" for spike in spikes[:most])
    return f"at {times}{', …' if len(spikes) > most else ''} s"
