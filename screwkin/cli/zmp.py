"""``screwkin zmp``."""

from __future__ import annotations

from screwkin.analysis.account import account_of, recorded_robot
from screwkin.cli.options import AsJson, TrajectoryPath
from screwkin.cli.output import aligned, print_json, remark
from screwkin.report.numbers import balance_data, balance_numbers
from screwkin.trajectory import load_trajectory


def zmp(trajectory: TrajectoryPath, as_json: AsJson = False) -> int:
    """Recompute CoM, ZMP, margins and spikes from the joints' positions, rates and accelerations.

    Exit code 3 if the ZMP leaves the support polygon.
    """
    loaded = load_trajectory(trajectory)
    account = account_of(recorded_robot(loaded, str(trajectory)), loaded)
    if as_json:
        print_json({"robot": account.robot.name, "samples": loaded.samples, **balance_data(account)})
    else:
        print(f"{trajectory}: {account.robot.name}, {loaded.samples} samples, {loaded.duration:.2f} s")
        print(aligned(balance_numbers(account), "  "))
        for warning in account.warnings:
            remark(f"warning: {warning}")
    return 3 if account.outside.any() else 0
