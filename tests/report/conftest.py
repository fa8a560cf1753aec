"""One short walk and its account, as in the tests of the analysis."""

from tests.analysis.conftest import account, check, robot, tipping, trajectory

__all__ = ["account", "check", "robot", "tipping", "trajectory"]
