"""One short walk, its account, and a run of it by perfect tracking."""

import pytest

import screwkin as sk
from screwkin.analysis.account import account_of
from screwkin.analysis.validate import validate


@pytest.fixture(scope="session")
def robot():
    return sk.load_robot("bioloid")


@pytest.fixture(scope="session")
def trajectory(robot):
    return sk.walk(robot, sk.load_gait("paper"), steps=4, command="screwkin walk bioloid --gait paper")


@pytest.fixture(scope="session")
def account(robot, trajectory):
    return account_of(robot, trajectory)


@pytest.fixture(scope="session")
def tipping(robot):
    """The account of a walk whose ZMP leaves the support polygon."""
    return account_of(robot, sk.walk(robot, sk.load_gait("paper").replace(sway=0), steps=2))


@pytest.fixture(scope="session")
def check(robot, trajectory):
    """A simulation without forces: quick, and it never passes."""
    return validate(robot, trajectory, "kinematic")
