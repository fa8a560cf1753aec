"""The choice of primary couplings: what is refused, and whether the advice in the message is good."""

from __future__ import annotations

import re

import numpy as np
import pytest

import screwkin as sk
from screwkin.errors import InputError, SingularError, UnknownNameError
from screwkin.model.table import load_robot
from tests.kinematics.machines import closed, random_tree


@pytest.fixture(scope="module")
def bioloid():
    return load_robot("bioloid")


@pytest.fixture(scope="module")
def default(bioloid):
    return sk.closed_mechanism(bioloid)


def test_the_default_choice_written_out_is_accepted_in_any_order(bioloid, default):
    again = sk.closed_mechanism(bioloid, primary=default.primary[::-1])
    assert again.primary == default.primary
    assert again.secondary == default.secondary
    assert set(again.primary) | set(again.secondary) == set(again.couplings)


def test_an_unknown_coupling_is_refused_and_the_valid_ones_are_listed(bioloid):
    with pytest.raises(UnknownNameError, match=r"unknown coupling 'nose.px'; valid: waist.px, waist.py"):
        sk.closed_mechanism(bioloid, primary=["nose.px"])


def test_a_single_text_and_a_name_twice_are_refused(bioloid, default):
    with pytest.raises(InputError, match=r"primary is the text 'waist\.px'; give a list"):
        sk.closed_mechanism(bioloid, primary="waist.px")
    with pytest.raises(InputError, match=r"primary names waist\.px twice"):
        sk.closed_mechanism(bioloid, primary=["waist.px", *default.primary])


def test_too_few_primary_couplings_name_the_ones_to_add(bioloid, default):
    short = [name for name in default.primary if name not in ("waist.rz", "left_hand.py")]
    with pytest.raises(InputError, match="26 secondary couplings but N has rank 24: 2 too many") as caught:
        sk.closed_mechanism(bioloid, primary=short)
    advised = re.search(r"make primary: ([\w., ]+)", str(caught.value))[1].split(", ")
    assert sk.closed_mechanism(bioloid, primary=[*short, *advised]).mobility == 24


def test_too_many_primary_couplings_name_the_ones_to_free(bioloid, default):
    long = [*default.primary, "right_knee", "left_elbow"]
    with pytest.raises(InputError, match="22 secondary couplings but N has rank 24: 2 too few") as caught:
        sk.closed_mechanism(bioloid, primary=long)
    advised = re.search(r"make secondary: ([\w., ]+)", str(caught.value))[1].split(", ")
    assert sk.closed_mechanism(bioloid, primary=set(long) - set(advised)).mobility == 24


def test_a_dependent_choice_names_the_couplings_to_exchange(bioloid, default):
    """All six of the right foot and of the right leg imposed by halves: the other leg cannot close."""
    wrong = (set(default.primary) - {"left_foot.px"}) | {"right_knee"}
    with pytest.raises(SingularError, match=r"dependent \(rank 23 of 24\)") as caught:
        sk.closed_mechanism(bioloid, primary=wrong)
    text = str(caught.value)
    impose = re.search(r"make primary ([\w., ]+), whose", text)[1].split(", ")
    free = re.search(r"make secondary ([\w., ]+), which", text)[1].split(", ")
    repaired = (wrong | set(impose)) - set(free)
    assert sk.closed_mechanism(bioloid, primary=repaired).mobility == 24


def test_too_few_and_dependent_is_repaired_by_the_message_too(bioloid, default):
    wrong = set(default.primary) - {"waist.px", "left_foot.px"} | {"right_knee"}
    with pytest.raises(InputError, match="1 too many") as caught:
        sk.closed_mechanism(bioloid, primary=wrong)
    text = str(caught.value)
    impose = re.search(r"make primary: ([\w., ]+)", text)[1].split(", ")
    repaired = wrong | set(impose)
    exchange = re.search(r"instead of ([\w., ]+): ([\w., ]+)", text)
    if exchange:
        repaired = (repaired | set(exchange[1].split(", "))) - set(exchange[2].split(", "))
    assert sk.closed_mechanism(bioloid, primary=repaired).mobility == 24


def test_the_waist_may_follow_while_feet_and_joints_impose(bioloid, default):
    """The strength of the method: here both knees drive, and the waist's height and pitch follow."""
    primary = (set(default.primary) - {"waist.pz", "waist.px"}) | {"right_knee", "right_hip_pitch"}
    mechanism = sk.closed_mechanism(bioloid, primary=primary)
    assert "waist.pz" in mechanism.secondary
    rates = np.zeros(24)
    rates[mechanism.primary.index("right_knee")] = 0.1
    found = sk.secondary_rates(mechanism, sk.home(bioloid), rates)
    full = np.empty(48)
    full[mechanism.primary_columns], full[mechanism.secondary_columns] = rates, found
    assert np.abs(sk.network_matrix(mechanism, sk.home(bioloid)) @ full).max() < 1e-13
    assert abs(found[mechanism.secondary.index("waist.pz")]) > 1e-3


def test_a_serial_arm_without_tips_has_no_circuits_and_only_primary_joints():
    mechanism = sk.closed_mechanism(random_tree(1, 4, base="fixed"))
    assert mechanism.circuits == ()
    assert mechanism.secondary == ()
    assert mechanism.mobility == 4 == mechanism.kutzbach
    state = sk.home(mechanism.robot)
    assert sk.network_matrix(mechanism, state).shape == (0, 4)
    assert sk.secondary_rates(mechanism, state, np.ones((3, 4))).shape == (3, 0)


def test_a_rigid_loop_has_mobility_zero_and_nothing_to_impose():
    """Six joints in a random loop: all are secondary."""
    robot = closed(random_tree(5, 6, branching=False, base="fixed"), [("link_6", "base")], 5)
    mechanism = sk.closed_mechanism(robot)
    assert mechanism.mobility == 0
    assert mechanism.primary == ()
    with pytest.raises(InputError, match="1 too few, the circuits could not close; make secondary: joint_2"):
        sk.closed_mechanism(robot, primary=["joint_2"])


@pytest.mark.parametrize(
    ("name", "primary"),
    [
        ("four-bar", ("crank",)),
        ("slider-crank", ("crank",)),
        ("bennett", ("axis_1",)),
        ("rssr", ("crank", "near_spin")),
        ("stewart", tuple(f"leg_{i}" for i in range(1, 7))),
    ],
)
def test_the_linkages_are_driven_where_one_would_drive_them(name, primary):
    assert sk.closed_mechanism(load_robot(f"linkages/{name}")).primary == primary


def test_the_four_bar_may_be_driven_at_its_rocker():
    mechanism = sk.closed_mechanism(load_robot("linkages/four-bar"), primary=["rocker"])
    assert mechanism.secondary == ("crank", "crank_pin", "rocker_pin")
