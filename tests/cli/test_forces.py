"""``screwkin forces``: loads on the command line, and what balances them."""

from __future__ import annotations

import numpy as np
import pytest

FOUR_BAR = ("forces", "linkages/four-bar")


def test_a_load_on_the_rocker_is_balanced_by_the_crank(cli):
    told = cli(*FOUR_BAR, "--load", "rocker=10", "--json").data
    assert told["actions"]["crank"] == pytest.approx(-2.4088, abs=5e-5)
    np.testing.assert_allclose(np.abs(told["wrenches"]["rocker"][3:]), [68.27, 37.96, 0], atol=5e-3)
    assert (told["action_matrix"], told["rank"], told["degree"]) == ([18, 22], 18, 4)
    assert list(told["redundant"]) == ["rocker.fs", "rocker.mu", "rocker.mv"]
    assert told["max_effort"] == pytest.approx(10)
    text = cli(*FOUR_BAR, "--load", "rocker=10").out
    assert "crank       -2.4088 N m    68.2719    37.9558     0.0000  78.1133   undecided: fs mu mv" in text
    assert "action matrix A        18 x 22, rank 18" in text
    assert "rocker.fs            force along (0, 0, 1) through (0.2, 0, 0) m" in text


def test_a_force_at_a_point_is_a_wrench_about_the_origin(cli):
    at = cli(*FOUR_BAR, "--load", "coupler=1,5,0@0.1,0.2,0", "--json").data
    about = cli(*FOUR_BAR, "--load", "coupler=0,0,0.3,1,5,0", "--json").data
    assert at["actions"] == pytest.approx(about["actions"])


def test_a_standing_robot_carries_its_weight(cli):
    told = cli("forces", "bioloid", "--weights", "--impose", "left_foot.fz=0", "--json").data
    assert told["wrenches"]["right_foot"][5] == pytest.approx(16.677)
    assert told["max_contact_force"] == pytest.approx(16.677, rel=1e-2)
    assert "18 joints" not in cli("forces", "bioloid", "--weights").err


def test_weights_pull_where_down_points(cli, tmp_path):
    from screwkin.model.library import find_robot

    text = find_robot("linkages/four-bar").read_text(encoding="utf-8")
    heavy = tmp_path / "heavy.toml"
    massive = 'mass = 1\ncom = ["crank/2", 0, 0]\ninertia = { box = [0.06, 0.01, 0.01] }'
    heavy.write_text(text.replace('"crank"\nmass = 0', f'"crank"\n{massive}'), encoding="utf-8")
    lying = cli("forces", str(heavy), "--weights", "--json").data
    assert lying["actions"]["crank"] == pytest.approx(0, abs=1e-12)
    upright = cli("forces", str(heavy), "--weights", "--down", "0,-1,0", "--json").data
    assert upright["actions"]["crank"] == pytest.approx(9.81 * 0.03 * np.cos(np.pi / 3))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "nothing loads it; add --load NAME=VALUES, --impose ACTION=VALUE or --weights"),
        (["--load", "rocker"], "--load 'rocker' is no assignment; write --load rocker=10"),
        (["--load", "rocker=1,2"], "--load rocker '1,2' is no list of numbers; write 1 or 3 or 6 numbers"),
        (["--load", "rocker=1@0,0,0"], "a place belongs to a force of three numbers"),
        (["--load", "rocker=nan"], "holds NaN or infinity"),
        (["--load", "rocker=1", "--load", "rocker=2"], "--load rocker is given twice; add the two up"),
        (["--load", "roker=1"], "Did you mean 'rocker'"),
        (["--impose", "crank=1", "--impose", "crank=1"], "--impose crank is given twice"),
        (["--impose", "crank=1", "--impose", "rocker=1"], "cannot be imposed"),
        (["--weights", "--down", "0,0,0"], "--down '0,0,0' is no direction"),
        (["--weights", "--active", "pin"], "unknown joint 'pin'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(cli, words, message):
    called = cli(*FOUR_BAR, *words)
    assert called.code == 2
    assert message in called.err
    assert called.err.count("\n") == 1


def test_a_linkage_s_efforts_have_a_closed_form(cli):
    text = cli(*FOUR_BAR, "--load", "rocker=10", "--symbolic").out
    form = "-crank*load*sin(q_crank_pin)/(crank*sin(q_crank_pin) - ground*sin(q_crank + q_crank_pin))"
    assert f"crank  {form}" in text
    told = cli(*FOUR_BAR, "--load", "rocker=10", "--symbolic", "--json").data
    assert told == {"robot": "four-bar", "load": "rocker", "efforts": {"crank": form}}
    for words in (["--load", "coupler=1,2,0"], [], ["--load", "rocker=1", "--load", "crank_pin=1"]):
        called = cli(*FOUR_BAR, *words, "--symbolic")
        assert (called.code, "--symbolic takes one load on a joint" in called.err) == (2, True)
    assert (
        "--weights: no part of a closed form; leave it out" in cli(*FOUR_BAR, "--symbolic", "--weights").err
    )


def test_loads_that_nothing_holds_are_an_answer_that_is_no(cli):
    """The rod of an RSSR spins between its balls, whatever the crank does."""
    called = cli("forces", "linkages/rssr", "--load", "rod=1,2,3,0,0,0", "--active", "crank")
    assert called.code == 3
    assert "no actions balance the loads: nothing holds the motion of near_" in called.err
    assert "add the effort of one of them to active" in called.err
