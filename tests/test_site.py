"""The site's pages of reference: every key, option and name of the code stands there, with its meaning."""

from __future__ import annotations

import importlib.util
import re
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import pytest
import typer

import screwkin as sk
from screwkin.cli import VERBS, verb_app
from screwkin.gait.keypoints import CHANNELS
from screwkin.gait.keys import KEYS
from screwkin.gait.record import Gait
from screwkin.model import schema

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def references() -> ModuleType:
    monkeypatch = pytest.MonkeyPatch()
    monkeypatch.syspath_prepend(DOCS)
    spec = importlib.util.spec_from_file_location("references", DOCS / "references.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.undo()
    return module


def rows(page: str) -> dict[str, list[str]]:
    """First cells without their marks, and the other cells, of all tables of a page."""
    found = {}
    for line in page.splitlines():
        if line.startswith("| `"):
            first, *others = re.split(r"(?<!\\) \| ", line.strip("| "))
            found[first.strip("`")] = others
    return found


def test_every_key_of_a_table_is_explained(references: ModuleType) -> None:
    page = references.robot_tables()
    explained = rows(page)
    for kind in (schema.RobotRow, *schema.ROWS.values(), schema.FrameRow, schema.MimicRow, schema.SpringRow):
        assert all(len(explained[name][0]) > 3 for name in kind.model_fields), kind
    assert all(f"`{name}`" in page for name in schema.TABLES)


def test_every_key_of_a_gait_has_meaning_and_default(references: ModuleType) -> None:
    explained = rows(references.gaits())
    assert {*KEYS, *CHANNELS} <= {*explained}
    gait = sk.load_gait("walk")
    for name, key in KEYS.items():
        assert hasattr(gait, name), name
        assert len(explained[name][0]) > 3
        assert key.default is None or f"`{key.default}`" == explained[name][2] or key.default == ""
    assert {*KEYS} <= {*Gait.__dataclass_fields__}


@pytest.mark.parametrize("robot", ["poppy12", "bioloid"])
def test_bipeds_walk_the_gait_of_the_page(references: ModuleType, tmp_path: Path, robot: str) -> None:
    path = tmp_path / "small.toml"
    path.write_text(references.SMALL_GAIT, encoding="utf-8")
    loaded = sk.load_robot(robot)
    assert sk.zmp(loaded, sk.walk(loaded, sk.load_gait(path), 2)).margin.min() > 0.005
    assert references.SMALL_GAIT in references.gaits()


def test_every_verb_and_option_stands_on_the_page_of_commands(references: ModuleType) -> None:
    page = references.commands()
    for verb in VERBS:
        assert f"## screwkin {verb}\n" in page
        command = typer.main.get_command(verb_app(verb))
        for one in [command, *getattr(command, "commands", {}).values()]:
            for parameter in one.params:
                if parameter.param_type_name == "option" and not parameter.hidden:
                    assert parameter.opts[0] in page
                    assert parameter.help, (verb, parameter.name)


def test_every_picture_of_the_gallery_is_there(references: ModuleType) -> None:
    page = references.PAGES["gallery"]()
    images = re.findall(r"!\[[^\]]+\]\(\.\./([^)]+)\)", page)
    assert len(images) > 4
    assert all((DOCS / image).is_file() for image in images)
    assert {path.stem for path in (DOCS / "images" / "gallery").iterdir()} == {Path(i).stem for i in images}


@pytest.mark.parametrize("written", ["records", "functions"])
def test_pages_of_names_hold_them_all(references: ModuleType, written: str) -> None:
    page: Callable[[], str] = getattr(references, written)
    expected = (
        [*sk.__all__, *(kind.__name__ for kind in references.raised_classes())]
        if written == "functions"
        else ["trajectory_sha256", "push", "coulomb", "stall_torque"]
    )
    assert all(name in page() for name in expected)
