"""Manners of the command line: names nearly right, narrow terminals, silence, colours, completion."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import pytest
import typer
from hypothesis import given, settings
from hypothesis import strategies as st

from screwkin.cli import OPTIONS, VERBS, completion, run, verb_app
from screwkin.cli.completers import VALUES
from screwkin.cli.output import progress_bar, remark, say
from screwkin.cli.terminal import GAP, Manners, folded, manners, table_lines, with_manners

WORDS = st.text("abc-,.:(", min_size=1, max_size=12)
CELLS = st.lists(WORDS, min_size=1, max_size=8).map(" ".join)
TABLES = st.integers(1, 6).flatmap(
    lambda count: st.lists(st.lists(CELLS, min_size=count, max_size=count), min_size=1, max_size=5)
)


class Terminal:
    """A stream that says it is a terminal, and keeps what is written."""

    def __init__(self) -> None:
        self.written = ""

    def write(self, text: str) -> int:
        self.written += text
        return len(text)

    def flush(self) -> None: ...

    def isatty(self) -> bool:
        return True


@settings(max_examples=30)
@given(TABLES, st.integers(20, 120))
def test_no_word_is_lost_or_broken_and_lines_fit_wherever_words_do(cells, width):
    lines = table_lines(cells, width)
    text = "\n".join(lines)
    for row in cells:
        for cell in row:
            for word in cell.split(" "):
                assert re.search(rf"(?<!\S){re.escape(word)}(?!\S)", text), (word, text)
    words = [max(len(word) for row in cells for word in row[k].split(" ")) for k in range(len(cells[0]))]
    if len(words) == 1 or max(words[0] + GAP + word for word in words[1:]) <= width:
        assert max(map(len, lines)) <= max(width, *words), text
    assert all(line == line.rstrip() for line in lines)


@settings(max_examples=15)
@given(TABLES)
def test_a_wide_terminal_gets_the_lines_of_a_file(cells):
    lines = table_lines(cells, None)
    assert table_lines(cells, max(map(len, lines))) == lines
    assert len(lines) == len(cells)


def test_vectors_stay_whole_and_groups_begin_with_the_first_column():
    head, row = ["joint", "s", "s0 [m]"], ["hip", "(0, 0, 1)", "(0, -0.04, 0)"]
    groups = ["joint  s", "hip    (0, 0, 1)", "joint  s0 [m]", "hip    (0, -0.04, 0)"]
    assert table_lines([head, row], 22) == groups


def test_prose_is_folded_further_in_on_terminals_and_where_columns_are_named_only(monkeypatch):
    text = "  files in runs/one: " + ", ".join(f"picture-{k}.png" for k in range(5))
    monkeypatch.delenv("COLUMNS", raising=False)
    with open(os.devnull) as file:
        assert folded(text, file) == text
    monkeypatch.setenv("COLUMNS", "40")
    lines = folded(text, Terminal()).splitlines()
    assert max(map(len, lines)) <= 40
    assert len(lines) > 2
    assert all(line.startswith("    p") for line in lines[1:])
    assert " ".join(line.strip() for line in lines) == text.strip()


def test_a_rule_under_a_title_ends_with_the_line(monkeypatch):
    monkeypatch.setenv("COLUMNS", "40")
    for rule in ("-" * 63, "=" * 41):
        assert folded(f"title\n{rule}\nrest", Terminal()) == f"title\n{rule[:40]}\nrest"


def test_quiet_leaves_no_results_remarks_or_bars(capsys, monkeypatch):
    with with_manners(["walk", "--quiet"]) as words:
        assert words == ["walk"]
        say("result")
        remark("remark")
        monkeypatch.setattr(sys, "stderr", Terminal())
        with progress_bar("walk") as done:
            done(0.5)
        assert sys.stderr.written == ""
    assert capsys.readouterr() == ("", "")
    assert manners() == Manners()


def test_a_quiet_verb_writes_its_files_and_a_refusal_is_still_said(cli, tmp_path):
    called = cli("convert", "linkages/four-bar", tmp_path / "bar.toml", "--quiet")
    assert (called.code, called.out, called.err) == (0, "", "")
    assert (tmp_path / "bar.toml").exists()
    assert "unknown robot" in cli("info", "nobody", "--quiet").err
    assert cli("robots", "--json", "--quiet").data["names"]


@pytest.mark.parametrize("way", ["--no-color", "NO_COLOR"])
def test_bars_are_without_colours_where_asked(monkeypatch, way):
    def drawn(*words: str) -> str:
        monkeypatch.setattr(sys, "stderr", Terminal())
        with with_manners(words), progress_bar("walk") as done:
            done(0.5)
        return sys.stderr.written

    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    coloured = re.compile(r"\x1b\[[\d;]*3\d")
    assert coloured.search(drawn())
    if way == "NO_COLOR":
        monkeypatch.setenv("NO_COLOR", "1")
    plain = drawn(*([way] if way.startswith("-") else []))
    assert "50%" in plain
    assert not coloured.search(plain)


@pytest.mark.parametrize(("name", "value"), [("TERM", "dumb"), ("TTY_INTERACTIVE", "0")])
def test_no_bar_is_drawn_where_it_could_not_move(monkeypatch, name, value):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv(name, value)
    with progress_bar("walk") as done:
        done(0.5)
    assert sys.stderr.written == ""


MISSPELT = [
    ("wlak", "walk"),
    ("--verion", "--version"),
    ("bus scna", "scan"),
    ("walk bioloid --stpes 3", "--steps"),
    ("walk bioloid --quite", "--quiet"),
    ("walk boiloid", "bioloid"),
    ("walk bioloid --gait smoth", "smooth"),
    ("walk bioloid --set strid=0.1", "stride"),
    ("walk bioloid --set kind=geometrc", "geometric"),
    ("walk poppy12 --compensate jont", "joint"),
    ("validate walk.npz --engine mujco", "mujoco"),
    ("validate walk.npz --perturb slop=1,0", "slope"),
    ("sweep bioloid --servo tabel", "table"),
    ("sweep bioloid --set engin=mujoco", "engine"),
    ("sweep bioloid --set Tc=1:2 --optimise margn", "margin"),
    ("ik bioloid rigt_leg", "right_leg"),
    ("workspace bioloid --limb right_leeg", "right_leg"),
    ("stiffness bioloid --support right_fot", "right_foot"),
    ("forces bioloid --load right_fot=1,2,3", "right_foot"),
    ("info bioloid --posture hom", "home"),
    ("info bioloid --primary waist.pxx", "waist.px"),
    ("info linkages/four-bar --move crnk=1", "crank"),
    ("convert poppy12 a.csv --convention modifed", "modified"),
    ("codegen bioloid --what ikk", "ik"),
    ("bus profiles AX-21A", "AX-12A|AX-18A"),
    ("send walk.npz --on-fault hlod", "hold"),
    ("send walk.npz --virtual --inject-fault daef@1", "deaf"),
    ("reproduce popy12", "poppy12"),
]


@pytest.mark.parametrize(("line", "meant"), MISSPELT, ids=[line for line, _ in MISSPELT])
def test_a_name_that_is_nearly_right_is_answered_by_the_right_one(cli, refused, line, meant):
    assert re.search(f"Did you mean '({meant})'", refused(cli(*line.split()), 2))


@pytest.mark.parametrize(("row", "key", "meant"), [("robot", "nmae", "name"), ("joint", "uper", "upper")])
def test_a_key_of_a_table_too(cli, refused, tmp_path, row, key, meant):
    head = f"[{row}]" if row == "robot" else f"[[{row}]]"
    (tmp_path / "odd.toml").write_text(f"{head}\n{key} = 1\n", encoding="utf-8")
    assert f"Did you mean '{meant}'" in refused(cli("info", "odd.toml"), 2)


def completed(line: str, capsys, monkeypatch) -> list[str]:
    """What bash gets for the last word of a line."""
    words = line.split(" ")
    monkeypatch.setenv("COMP_WORDS", line)
    monkeypatch.setenv("COMP_CWORD", str(len(words) - 1))
    monkeypatch.setenv("_SCREWKIN_COMPLETE", "complete_bash")
    assert run([]) == 0
    return capsys.readouterr().out.split()


@pytest.mark.parametrize(
    ("line", "answers"),
    [
        ("screwkin wo", ["workspace"]),
        ("screwkin --qui", ["--quiet"]),
        ("screwkin bus sc", ["scan"]),
        ("screwkin walk bioloid2", ["bioloid24"]),
        ("screwkin table linkages/s", ["linkages/slider-crank", "linkages/stewart"]),
        ("screwkin walk bioloid --gait sm", ["smooth"]),
        ("screwkin walk bioloid --set stri", ["stride="]),
        ("screwkin walk bioloid --ste", ["--steps"]),
        ("screwkin validate walk.npz --engine mu", ["mujoco"]),
        ("screwkin validate walk.npz --servo ri", ["rigid"]),
        ("screwkin walk own/ro", ["own/robot.toml"]),
        ("screwkin view own/w", ["own/walk.npz"]),
        ("screwkin reproduce poppy", ["poppy12"]),
    ],
)
def test_the_shell_completes_verbs_options_names_and_files(line, answers, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own").mkdir()
    for name in ("robot.toml", "robot.txt", "walk.npz"):
        (tmp_path / "own" / name).touch()
    assert completed(line, capsys, monkeypatch) == answers


def test_every_completer_gives_something_and_serves_a_parameter():
    commands = {verb: typer.main.get_command(verb_app(verb)) for verb in VERBS}
    known = [
        f"{verb} {parameter.name}"
        for verb, command in commands.items()
        for one in (command, *getattr(command, "commands", {}).values())
        for parameter in one.params
    ]
    for key, complete in VALUES.items():
        assert complete(""), key
        assert any(name == key or name.endswith(f" {key}") for name in known), key


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_the_script_of_completion_is_shown_and_installed(cli, shell, monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    shown = cli("--show-completion", shell)
    assert shown.code == 0
    assert "_SCREWKIN_COMPLETE" in shown.out
    assert cli("--install-completion", shell).code == 0
    installed = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert any("_SCREWKIN_COMPLETE" in path.read_text(encoding="utf-8") for path in installed)


def test_a_shell_that_is_not_known_is_refused(cli, refused):
    assert "valid: bash, zsh, fish" in refused(cli("--show-completion", "csh"), 2)


def test_help_names_every_option_of_all_verbs(cli):
    assert all(f"  {option}" in cli("--help").out for option in OPTIONS)


def test_results_go_through_one_function_that_quiet_silences():
    """All but shell scripts, the version and errors; so a verb that is added is quiet too."""
    folder = Path(completion.__file__).parent
    texts = {path.name: path.read_text(encoding="utf-8") for path in folder.glob("*.py")}
    printing = {name for name, text in texts.items() if re.search(r"(?<![\w.])print\(", text)}
    assert printing == {"__init__.py", "completion.py", "output.py"}
