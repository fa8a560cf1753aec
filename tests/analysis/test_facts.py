"""The facts of a mechanism, against counts made by hand."""

import numpy as np
import pytest

import screwkin as sk
from screwkin.analysis.facts import facts_of
from screwkin.errors import UnknownNameError


def test_counts_follow_from_the_table(robot):
    facts = facts_of(robot)
    virtual = 6 + 6 * len(robot.limbs)
    assert facts.network_shape == (6 * len(robot.limbs), len(robot.joints) + virtual)
    assert facts.mobility == facts.network_shape[1] - facts.rank
    assert facts.actuated_joints == robot.joint_names


def test_the_condition_is_that_of_the_secondary_columns(robot):
    facts = facts_of(robot)
    mechanism = facts.mechanism
    N = sk.network_matrix(mechanism, sk.home(robot))
    columns = [mechanism.couplings.index(name) for name in mechanism.secondary]
    assert facts.condition == pytest.approx(np.linalg.cond(N[:, columns]))
    point = np.array([0.3, -2.0, 1.0])
    N = sk.network_matrix(mechanism, sk.home(robot), point=point)
    place = (0.0, 0.0, float(sk.home(robot).T_world_base[2, 3]))
    assert facts_of(robot, place=place, point=tuple(point)).condition == pytest.approx(
        np.linalg.cond(N[:, columns])
    )


def test_a_linkage_is_driven_by_its_primary_joint():
    facts = facts_of(sk.load_robot("linkages/four-bar"))
    assert facts.actuated_joints == facts.mechanism.primary
    assert facts.to_dict()["kutzbach"] == -2
    assert facts.mobility == 1


def test_an_unknown_posture_is_refused(robot):
    with pytest.raises(UnknownNameError, match="dancing"):
        facts_of(robot, "dancing")
