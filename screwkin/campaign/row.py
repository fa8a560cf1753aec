"""One row of a campaign: plan its walk, simulate it, and say what happened."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import lru_cache
from typing import cast

from screwkin.analysis.engines import Engine, confirms
from screwkin.analysis.validate import Validation, validate
from screwkin.campaign.outcome import Outcome, crashed
from screwkin.campaign.plan import CONDITIONS, ON, Campaign, CampaignRow
from screwkin.campaign.world import world_along
from screwkin.errors import NoSolutionError
from screwkin.gait.record import Gait, gait_from_dict
from screwkin.gait.walk import walk
from screwkin.model.robot import Robot
from screwkin.model.table import robot_from_text
from screwkin.sim.perturbation import Perturbation
from screwkin.sim.perturbation_files import described
from screwkin.trajectory import Trajectory


def played_row(campaign: Campaign, row: CampaignRow) -> Outcome:
    """Play a row; whatever goes wrong in it is its outcome."""
    try:
        robot, trajectory = _robot(campaign.robot), walk_of_setting(campaign, row.values)
        world = _world(row, robot, trajectory)
        check = validate(
            robot,
            trajectory,
            cast(Engine, row.values["engine"]),
            servo=row.values["servo"],
            perturbation=world,
            feedback=row.values["feedback"] == ON,
        )
        return _outcome(row, check, world)
    except NoSolutionError as error:
        return Outcome(row.index, "refused", reason=str(error))
    except Exception as error:
        return crashed(row, error)


def walk_of_setting(campaign: Campaign, values: Mapping[str, str]) -> Trajectory:
    """The walk of a setting; the processes of a campaign remember the last ones.

    Raises:
        NoSolutionError: there is none. GaitError, InputError: its gait does not fit the robot.
    """
    walked = _planned(campaign.robot, campaign.gaits[values["gait"]], _parameters(values))
    if isinstance(walked, NoSolutionError):
        raise walked
    return walked


def gait_of(campaign: Campaign, values: Mapping[str, str]) -> Gait:
    """The gait of a setting.

    Raises:
        GaitError: a key or a value is none of the gait's.
    """
    return _gait(campaign.gaits[values["gait"]], _parameters(values))


def _parameters(values: Mapping[str, str]) -> tuple[tuple[str, str], ...]:
    return tuple((key, text) for key, text in values.items() if key not in CONDITIONS)


def _gait(document: str, parameters: tuple[tuple[str, str], ...]) -> Gait:
    gait = gait_from_dict(json.loads(document))
    return gait.replace(**dict(parameters)) if parameters else gait


@lru_cache(1)
def _robot(text: str) -> Robot:
    return robot_from_text(text)


@lru_cache(8)
def _planned(
    robot: str, document: str, parameters: tuple[tuple[str, str], ...]
) -> Trajectory | NoSolutionError:
    """The walk, or why there is none: to say so, with values that work, takes longer than a walk."""
    try:
        return walk(_robot(robot), _gait(document, parameters))
    except NoSolutionError as error:
        return error


def _world(row: CampaignRow, robot: Robot, trajectory: Trajectory) -> Perturbation:
    return world_along(row.values["perturb"], robot, row.seed, trajectory)


def _outcome(row: CampaignRow, check: Validation, world: Perturbation) -> Outcome:
    return Outcome(
        row=row.index,
        status="planned" if not confirms(check.engine) else "fell" if check.fell else "stood",
        passed=check.passed,
        reason="; ".join(check.reasons),
        fell_at=check.fell_at,
        margin_mm=check.min_margin_mm,
        zmp_rms_mm=check.zmp_rms_mm,
        end_error_mm=check.end_error_mm,
        slip_mm=check.slip_mm,
        tilt_deg=check.max_tilt_deg,
        world=" ".join(described(world)),
    )
