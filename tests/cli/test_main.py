"""The command as a whole: help, unknown words, errors of every kind, and what it loads to start."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

import screwkin.cli
from screwkin.cli import VERBS, run
from screwkin.errors import MissingDependencyError, SafetyError, UnreachableError

CHECKOUT = Path(__file__).resolve().parents[2]
HEAVY = {"jax", "scipy", "matplotlib", "sympy", "pybullet", "serial", "rich"}


def command(*words, **options):
    """The real command in a process of its own, from the checkout."""
    path = os.pathsep.join([str(CHECKOUT), os.environ.get("PYTHONPATH", "")])
    environment = {**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, "-m", "screwkin", *words],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        **options,
    )


@pytest.mark.parametrize("words", [(), ("--help",), ("-h",), ("help",)])
def test_help_lists_every_verb(cli, words):
    called = cli(*words)
    assert called.code == 0
    assert called.err == ""
    for verb in VERBS:
        assert f"  {verb} " in called.out


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_explains_itself_and_its_json(cli, verb):
    called = cli(verb, "--help")
    assert called.code == 0
    assert f"Usage: screwkin {verb}" in called.out
    assert "--json" in called.out


def test_the_version_is_that_of_the_package(cli):
    assert cli("--version").out == f"screwkin {screwkin.__version__}\n"


@pytest.mark.parametrize("words", [["--help"], ["robots"], ["gaits", "--json"]])
def test_help_and_listings_start_without_heavy_modules(tmp_path, words):
    code = (
        "import sys; from screwkin.cli import run; run(sys.argv[1:]); "
        f"print(sorted({HEAVY} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *words],
        env={**os.environ, "PYTHONPATH": str(CHECKOUT)},
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=60,
        check=True,
    )
    assert done.stderr.splitlines()[-1] == "[]"


@pytest.mark.parametrize(
    ("words", "named"),
    [
        (["wlak"], "unknown verb 'wlak'; valid: demo, robots"),
        (["--verbose"], "unknown option --verbose"),
        (["robots", "--colour"], "--colour"),
        (["info"], "ROBOT"),
        (["walk", "bioloid", "--steps", "many"], "--steps"),
        (["gaits", "surplus"], "surplus"),
    ],
)
def test_wrong_words_are_told_once_with_exit_code_2(cli, refused, words, named):
    assert named in refused(cli(*words), 2)


def test_an_unknown_verb_with_json_still_prints_one_object(cli):
    called = cli("wlak", "--json")
    assert called.data["exit_code"] == called.code == 2
    assert "wlak" in called.data["error"]


def broken(monkeypatch, error):
    """Make a verb raise."""

    def dispatch(words):
        raise error

    monkeypatch.setattr(screwkin.cli, "_dispatch", dispatch)


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (UnreachableError("left_leg, sample 3 (t = 0.060 s): out of reach", "left_leg", 3, 0.01), 3),
        (SafetyError("no passing validation"), 4),
        (MissingDependencyError("install pybullet"), 2),
        (ZeroDivisionError("division [by] zero"), 1),
    ],
)
def test_every_kind_of_error_has_its_exit_code_and_its_whole_message(cli, monkeypatch, error, code):
    broken(monkeypatch, error)
    called = cli("walk", "robot")
    assert called.code == code
    assert called.out == ""
    assert str(error) in called.err  # brackets and all
    assert ("--debug" in called.err) == (code == 1)


def test_a_limb_out_of_reach_is_named_in_json_too(cli, monkeypatch):
    broken(monkeypatch, UnreachableError("out of reach", "left_leg", 3, 0.01))
    assert cli("walk", "robot", "--json").data == {
        "error": "out of reach",
        "exit_code": 3,
        "limb": "left_leg",
        "sample": 3,
    }


def test_debug_shows_the_traceback_wherever_it_stands(cli, monkeypatch):
    broken(monkeypatch, ValueError("inside"))
    for words in (["--debug", "walk", "x"], ["walk", "x", "--debug"]):
        called = cli(*words)
        assert called.code == 1
        assert "Traceback" in called.err
    monkeypatch.setenv("SCREWKIN_DEBUG", "1")
    assert "Traceback" in cli("walk", "x").err


def test_an_interrupt_ends_cleanly_with_130(cli, monkeypatch):
    broken(monkeypatch, KeyboardInterrupt())
    called = cli("walk", "robot")
    assert (called.code, called.out, called.err) == (130, "", "interrupted\n")


def test_an_interrupt_before_the_verb_is_known_ends_alike(cli, monkeypatch):
    import screwkin.cli.terminal

    def interrupted(words):
        raise KeyboardInterrupt

    monkeypatch.setattr(screwkin.cli.terminal, "with_manners", interrupted)
    called = cli("gaits")
    assert (called.code, called.out, called.err) == (130, "", "interrupted\n")


def test_an_interrupt_inside_a_verb_is_no_error_of_ours(cli, monkeypatch):
    import screwkin.cli.gaits

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(screwkin.cli.gaits, "list_tables", interrupted)
    called = cli("gaits")
    assert (called.code, called.err) == (130, "interrupted\n")


def test_a_reader_that_goes_away_makes_no_noise(tmp_path):
    script = f"{sys.executable} -m screwkin table bioloid24 | true; echo ${{PIPESTATUS[0]}}"
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT), "PYTHONUNBUFFERED": "1"}
    done = subprocess.run(
        ["bash", "-c", script], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    assert done.stdout.strip() in ("0", "1")


@pytest.mark.parametrize("words", ["robots", "robots --json", "table nobody --json", "--help"])
def test_a_full_disk_under_stdout_is_one_message(tmp_path, words):
    """A file that may hold no byte stands for the disk; Python begins with the signal for it ignored."""
    script = f"ulimit -f 0; {sys.executable} -m screwkin {words} > out"
    environment = {**os.environ, "PYTHONPATH": str(CHECKOUT)}
    done = subprocess.run(
        ["bash", "-c", script], env=environment, cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stderr.startswith("error: ")
    assert done.stderr.count("\n") == 1 + done.stderr.count("\n  ")
    assert ("cannot write standard output" in done.stderr) == ("nobody" not in words)


def test_the_module_and_the_entry_point_are_the_same_command(tmp_path):
    done = command("robots", "--json", cwd=tmp_path)
    assert done.returncode == 0
    assert "bioloid" in json.loads(done.stdout)["names"]
    with pytest.raises(SystemExit) as ended:
        screwkin.cli.main(["wlak"])
    assert ended.value.code == 2


def test_no_progress_is_shown_in_a_pipe(tmp_path):
    done = command("walk", "bioloid", "--steps", "1", "--no-plots", "--json", "-o", "out", cwd=tmp_path)
    assert done.returncode == 0
    assert done.stderr == ""
    assert json.loads(done.stdout)["steps"] == 1


def test_run_returns_what_main_exits_with(capsys):
    assert run(["robots"]) == 0
    assert capsys.readouterr().out
