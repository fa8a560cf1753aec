"""``info``: the counts of the mechanism, and conditioning that does not depend on where the robot stands."""

import pytest

COUNTS = {
    "bioloid": {
        "actuated_joints": 18,
        "couplings": 48,
        "links": 45,
        "circuits": 4,
        "mobility": 24,
        "network_shape": [24, 48],
        "rank": 24,
    },
    "bioloid24": {
        "actuated_joints": 24,
        "couplings": 54,
        "links": 51,
        "circuits": 4,
        "mobility": 30,
        "network_shape": [24, 54],
        "rank": 24,
    },
    "linkages/four-bar": {"actuated_joints": 1, "couplings": 4, "links": 4, "circuits": 1, "mobility": 1},
    "linkages/bennett": {"couplings": 4, "circuits": 1, "mobility": 1, "kutzbach": -2},
    "linkages/stewart": {"actuated_joints": 6, "mobility": 6},
}


@pytest.mark.parametrize("name", COUNTS)
def test_the_counts_are_those_of_the_mechanism(cli, name):
    told = cli("info", name, "--json").data
    assert {key: told[key] for key in COUNTS[name]} == COUNTS[name]
    assert sorted(told["primary"] + told["secondary"]) == sorted(set(told["primary"] + told["secondary"]))
    assert len(told["primary"]) + len(told["secondary"]) == told["couplings"]


def test_mass_and_choice_of_couplings_are_those_of_the_table(cli):
    told = cli("info", "bioloid", "--json").data
    assert told["mass"] == pytest.approx(1.7, abs=1e-12)
    assert [name for name in told["secondary"] if "." in name] == [
        f"{side}_hand.r{axis}" for side in ("right", "left") for axis in "xyz"
    ]
    assert all("." in name for name in told["primary"])


def test_conditioning_stays_50_m_away_unless_n_is_formed_at_the_world_origin(cli):
    home = cli("info", "bioloid", "--json").data["condition"]
    away = cli("info", "bioloid", "--at", "50,0,0", "--json").data["condition"]
    spoilt = cli("info", "bioloid", "--at", "50,0,0", "--point", "0,0,0", "--json").data["condition"]
    assert 50 < home < 200
    assert away == pytest.approx(home, rel=1e-12)
    assert spoilt > 1e5


def test_straight_knees_are_singular_although_n_keeps_its_rank(cli):
    told = cli("info", "bioloid", "--posture", "zero", "--json").data
    assert told["rank"] == 24
    assert told["mobility"] == 24
    leg = next(limb for limb in told["singularity"] if limb["limb"] == "left_leg")
    assert leg["near"]
    assert "left_knee is near straight" in leg["cause"]
    assert not any(limb["near"] for limb in cli("info", "bioloid", "--json").data["singularity"])
    assert "NEAR A SINGULARITY" in cli("info", "bioloid", "--posture", "zero").out


def test_the_text_tells_the_same_numbers(cli):
    text = cli("info", "bioloid").out
    for part in ("1.7000 kg", "48: 18 real, 30 virtual", "24 x 48, rank 24", "waist.px py pz rx ry rz"):
        assert part in text


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["bioloid25"], "unknown robot 'bioloid25'; valid: bioloid"),
        (["./absent.toml"], "absent.toml"),
        (["bioloid", "--posture", "dancing"], "unknown posture 'dancing'; valid: "),
        (["bioloid", "--at", "1,2"], "--at '1,2' is no point"),
        (["bioloid", "--at", "0,nan,0"], "NaN"),
        (["bioloid", "--point", "a,b,c"], "--point"),
    ],
)
def test_wrong_input_is_told_once(cli, refused, words, named):
    assert named in refused(cli("info", *words), 2)


def test_every_fault_of_a_table_is_told(cli, refused, tmp_path):
    (tmp_path / "bad.toml").write_text('[robot]\nname = "bad"\nspeed = 3\n', encoding="utf-8")
    message = refused(cli("info", "./bad.toml"), 2)
    assert "speed" in message
    assert message.count("bad.toml") > 1


def test_every_limb_says_how_its_inverse_kinematics_is_solved(cli):
    limbs = cli("info", "bioloid", "--json").data["ik"]
    assert [(limb["limb"], limb["branches"]) for limb in limbs] == [
        (f"{side}_{part}", count) for part, count in (("leg", 8), ("arm", 4)) for side in ("right", "left")
    ]
    assert all(limb["solved"] == 1.0 for limb in limbs)
    text = cli("info", "bioloid").out
    assert "closed form: spherical hip  at most 8 branches  100.0% of 32 poses" in text


def test_a_singular_loop_is_explained_and_drawn(cli, tmp_path):
    """The four-bar driven by its rocker, moved to where crank and coupler are in line."""
    from math import acos

    crank = acos((0.2**2 + 0.24**2 - 0.14**2) / (2 * 0.2 * 0.24))
    words = ("info", "linkages/four-bar", "--primary", "rocker", "--move", f"crank={crank}")
    text = cli(*words, "-o", tmp_path).out
    assert "NEAR A SINGULARITY: crank_pin is near straight or fully folded" in text
    assert "free motion of crank: rotation about the axis (0, 0, 1) through (0, 0, 0) m" in text
    assert "free wrench: force along (0.8125, 0.583, 0) through (0.0939, 0.0674, 0) m" in text
    assert (tmp_path / "singularity.png").stat().st_size > 10_000
    (loop,) = cli(*words, "--json").data["singularity"]
    assert loop["free"]["body"] == "crank"
    assert loop["free"]["wrench"]["pitch"] == 0


@pytest.mark.parametrize(
    ("words", "code", "message"),
    [
        (["--move", "crank"], 2, "--move 'crank' is no assignment; write --move crank=0.5"),
        (["--move", "crunk=1"], 2, "Did you mean 'crank'"),
        (["--move", "rocker=1"], 2, "rocker is secondary"),
        (["--primary", "crank", "--primary", "rocker"], 2, "make secondary"),
    ],
)
def test_a_move_or_a_choice_that_cannot_be_is_refused(cli, words, code, message):
    called = cli("info", "linkages/four-bar", *words)
    assert called.code == code
    assert message in called.err


def test_the_graph_is_drawn_where_it_is_asked_for(cli, tmp_path):
    assert cli("info", "linkages/four-bar", "--graph", "-o", "out").code == 0
    assert (tmp_path / "out" / "graph.png").stat().st_size > 10_000


CHAIN = """
[[chain]]
name = "line"
couplings = "3P3R"
end = "right_hand"
start_frame = { xyz = [0, -0.065, 0], rpy = [0, "-30*deg", 0] }
"""


def test_a_chain_of_a_file_is_led(cli, tmp_path):
    """Along a line that rises by 30 degrees: 0.866 ahead and 0.5 up."""
    (tmp_path / "line.toml").write_text(CHAIN, encoding="utf-8")
    words = ("info", "bioloid", "--chains", "line.toml", "--move", "line.px=0.02", "--move", "line.pz=0")
    three = ("--rate", "line.px=0.1", "--rate", "line.py=0", "--rate", "line.pz=0")
    told = cli(*words, *three, "--json").data
    assert told["couplings"] == 54
    assert told["coordinates"]["line.px"] == pytest.approx(0.02, abs=1e-9)
    assert told["coordinates"]["line.pz"] == pytest.approx(0, abs=1e-9)
    hand = [told["rates"][f"right_hand.{c}"] for c in ("px", "py", "pz")]
    assert hand == pytest.approx([0.0866025404, 0, 0.05], abs=1e-9)
    assert "line.px 0.02" in cli(*words).out
