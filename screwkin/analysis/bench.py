"""The bench on which a paper's measures are taken: every robot, walk and study is made once."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar

from screwkin.analysis.compare import Comparison, compare_models
from screwkin.analysis.validate import Validation, validate
from screwkin.gait.files import load_gait
from screwkin.gait.walk import walk
from screwkin.model.robot import Robot
from screwkin.model.table import load_robot
from screwkin.report.account import Account, account_of
from screwkin.report.facts import Facts, facts_of

Made = TypeVar("Made")


class Bench:
    """What measures share. ``robot`` is the paper's, meant wherever a measure names none."""

    def __init__(self, robot: str) -> None:
        self._default = robot
        self._made: dict[tuple[object, ...], Any] = {}

    def once(self, key: tuple[object, ...], make: Callable[[], Made]) -> Made:
        """What ``make`` gives, made at the first call for a key."""
        if key not in self._made:
            self._made[key] = make()
        found: Made = self._made[key]
        return found

    def robot(self, name: str = "") -> Robot:
        """A robot; the paper's if no name is given."""
        chosen = name or self._default
        return self.once(("robot", chosen), lambda: load_robot(chosen))

    def facts(self, robot: str = "") -> Facts:
        """Counts and conditioning of a robot's closed mechanism at home."""
        table = self.robot(robot)
        return self.once(("facts", table.name), lambda: facts_of(table))

    def account(
        self,
        gait: str,
        steps: int | None = None,
        robot: str = "",
        changes: Mapping[str, str | float] | None = None,
    ) -> Account:
        """A walk and its balance."""
        table, changed = self.robot(robot), dict(changes or {})
        key = ("account", table.name, gait, steps, *sorted(changed.items()))

        def made() -> Account:
            chosen = load_gait(gait).replace(**changed) if changed else load_gait(gait)
            return account_of(table, walk(table, chosen, steps))

        return self.once(key, made)

    def validation(self, account: Account) -> Validation:
        """The verdict of the simulator on a walk."""
        trajectory = account.trajectory
        return self.once(("validation", trajectory.sha256), lambda: validate(account.robot, trajectory))

    def comparison(self, robot: str = "") -> Comparison:
        """Screws against DH tables."""
        table = self.robot(robot)
        return self.once(("comparison", table.name), lambda: compare_models(table, rounds=7))
