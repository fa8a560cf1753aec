"""``screwkin codegen``: its files compile without a warning and agree with Python."""

from __future__ import annotations

import subprocess
from typing import Any

import pytest

from screwkin.compiler import native

WARNINGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-O1")
needs_compiler = pytest.mark.skipif(native.compiler() is None, reason="no C compiler")


SETS = [
    ("bioloid", "ik,rates,tips,margin", "double"),
    ("bioloid", "ik,rates,tips,margin", "float"),
    ("poppy12", "ik,motion,com,zmp", "double"),
    ("poppy12", "ik,motion,com,zmp", "float"),
    ("poppy12", "deflection", "float"),
    ("bioloid", "stabiliser", "double"),
    ("poppy12", "links,jacobian,mass_matrix,inverse_dynamics", "double"),
]
FLAGS = ("-DSCREWKIN_PACKS", "-march=native", "-DSCREWKIN_SCALAR")
"""Packs of any processor (the macro means nothing), of this one, and single samples."""


def each_set_and_each_flag() -> list[Any]:
    """All pairs; the slow ones hold what pairs with the same set, and others with the same flag, hold."""
    quick = {(k, k % len(FLAGS)) for k in range(len(SETS))}
    return [
        pytest.param(*SETS[k], flag, marks=() if (k, n) in quick else pytest.mark.slow)
        for k in range(len(SETS))
        for n, flag in enumerate(FLAGS)
    ]


@needs_compiler
@pytest.mark.parametrize(("robot", "what", "kind", "flag"), each_set_and_each_flag())
def test_generated_c_compiles_without_warnings_and_its_driver_passes(cli, tmp_path, robot, what, kind, flag):
    flags = ["--float"] if kind == "float" else []
    done = cli("codegen", robot, "--what", what, *flags, "-o", str(tmp_path), "--json")
    assert done.code == 0
    told = done.data
    assert {f"{robot}.c", f"{robot}.h", f"test_{robot}.c", "README.md"} == set(told["files"])
    sources = [str(tmp_path / name) for name in (f"test_{robot}.c", f"{robot}.c")]
    driver = str(tmp_path / "driver")
    subprocess.run([native.compiler(), *WARNINGS, flag, "-o", driver, *sources, "-lm"], check=True)
    ran = subprocess.run([driver], check=False, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stdout
    assert ran.stdout.count("largest difference") >= 2 * len(told["operations"])


@needs_compiler
def test_the_driver_notices_a_wrong_sign(cli, tmp_path):
    assert cli("codegen", "poppy12", "--what", "com", "-o", str(tmp_path)).code == 0
    source = tmp_path / "poppy12.c"
    text = source.read_text()
    at = text.index("scatter(center_of_mass + 0, 3, ") + len("scatter(center_of_mass + 0, 3, ")
    source.write_text(text[:at] + "-" + text[at:])
    files = [str(tmp_path / name) for name in ("test_poppy12.c", "poppy12.c")]
    subprocess.run([native.compiler(), *WARNINGS, "-o", str(tmp_path / "driver"), *files, "-lm"], check=True)
    assert subprocess.run([str(tmp_path / "driver")], check=False, capture_output=True).returncode == 1


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("bioloid", "--what", "ik,magic"), "unknown kind of program 'magic'"),
        (("linkages/four-bar", "--what", "ik"), "no limb with a closed form"),
        (("linkages/four-bar", "--what", "rates"), "rates follow limbs"),
        (("linkages/four-bar", "--what", "margin"), "has no [[sole]]"),
        (("linkages/four-bar", "--what", "deflection"), "deflections are those of trees"),
        (("bioloid", "--what", ","), "nothing is asked for"),
    ],
)
def test_what_cannot_be_generated_is_told_and_leaves_no_files(cli, tmp_path, arguments, message):
    folder = tmp_path / "out"
    done = cli("codegen", *arguments, "-o", str(folder))
    assert done.code == 2
    assert message in done.err
    assert not folder.exists()
