"""The bench on which a paper's measures are taken: every robot, walk and study is computed once."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any, TypeVar

from screwkin.analysis.account import Account, account_of
from screwkin.analysis.compare import Comparison, compare_models
from screwkin.analysis.engines import RIGID, SimulatedCompliance
from screwkin.analysis.facts import Facts, facts_of
from screwkin.analysis.validate import Validation, validate
from screwkin.gait.files import load_gait
from screwkin.gait.record import Gait
from screwkin.gait.walk import walk
from screwkin.model.table import load_robot
from screwkin.papers.scatter import FEW, scattered, shaken

T = TypeVar("T")

Changes = Mapping[str, str | float]


class Bench:
    """What measures share.

    ``robot`` is the paper's; ``changes`` apply to every gait; ``runs``: how often a simulation that scatters
    is run.
    """

    def __init__(self, robot: str, changes: Changes | None = None, runs: int = FEW) -> None:
        self.robot, self.runs = load_robot(robot), runs
        self._changes = dict(changes or {})
        self._results: dict[tuple[object, ...], Any] = {}

    def once(self, key: tuple[object, ...], compute: Callable[[], T]) -> T:
        """The result of ``compute``, called once for every key."""
        if key not in self._results:
            self._results[key] = compute()
        result: T = self._results[key]
        return result

    def facts(self, robot: str = "") -> Facts:
        """Counts and conditioning of a robot's closed mechanism at home; default: the paper's robot."""
        return self.once(("facts", robot), lambda: facts_of(load_robot(robot) if robot else self.robot))

    def account(self, gait: str, steps: int | None = None, changes: Changes | None = None) -> Account:
        """A walk and its balance."""
        key = ("account", gait, steps, *sorted((changes or {}).items()))
        return self.once(
            key, lambda: account_of(self.robot, walk(self.robot, self.gait(gait, changes), steps))
        )

    def gait(self, name: str, changes: Changes | None = None) -> Gait:
        """A gait as the paper walks it, with further changes."""
        changed = {**self._changes, **(changes or {})}
        return load_gait(name).replace(**changed) if changed else load_gait(name)

    def validation(self, account: Account, sole_stiffness: float | None = None) -> Validation:
        """The verdict of the simulator on a walk, with rigid soles or elastic ones [N/m]."""
        trajectory, compliance = account.trajectory, SimulatedCompliance(sole_stiffness=sole_stiffness)
        key = ("validation", trajectory.sha256, sole_stiffness)
        return self.once(
            key, lambda: validate(account.robot, trajectory, "pybullet", servo=RIGID, compliance=compliance)
        )

    def verdicts(self, account: Account, sole_stiffness: float | None = None) -> tuple[dict[str, Any], ...]:
        """The verdicts of runs of a walk that differ by rounding; the first is that of ``validation``."""
        compliance = SimulatedCompliance(sole_stiffness=sole_stiffness)

        def verdict(run: int) -> dict[str, Any]:
            if not run:
                return self.validation(account, sole_stiffness).to_dict()
            trajectory = shaken(account.trajectory, run)
            return validate(
                account.robot, trajectory, "pybullet", servo=RIGID, compliance=compliance
            ).to_dict()

        key = ("verdicts", account.trajectory.sha256, sole_stiffness)
        return self.once(
            key, lambda: self.repeated(verdict, self.runs, lambda one: (one["fell_at"], one["zmp_max_mm"]))
        )

    @staticmethod
    def repeated(
        simulated: Callable[[int], T], runs: int, numbers: Callable[[T], Sequence[float | None]]
    ) -> tuple[T, ...]:
        """Results of runs 0, 1, ...: ``runs`` of them, or ``FEW`` if their ``numbers`` do not scatter."""
        results: list[T] = []
        while len(results) < runs and (len(results) != FEW or scattered([numbers(one) for one in results])):
            results.append(simulated(len(results)))
        return tuple(results)

    @cached_property
    def comparison(self) -> Comparison:
        """Screws against DH tables."""
        return compare_models(self.robot, rounds=7)
