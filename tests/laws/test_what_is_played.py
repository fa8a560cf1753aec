"""What was validated is what is played: nothing that changes the frames of a walk passes ``send``.

One field of trajectory, table or verdict is changed at random, by a forger who computes all anew that can be
computed without a simulator: hashes, margins and speeds. Either ``send`` refuses, or what reaches the servos
is within a tick what it was. All 10,000 changes, in some minutes:

    python -m pytest -m slow tests/laws/test_what_is_played.py
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import fields, replace
from os.path import isfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import screwkin as sk
from screwkin.analysis import readiness
from screwkin.analysis.account import recorded_robot
from screwkin.analysis.readiness import Ready, ready
from screwkin.errors import ScrewkinError
from screwkin.model.library import find_robot
from screwkin.trajectory import Trajectory, load_trajectory
from tests import verdicts
from tests.verdicts import passing_data

ARRAYS = ["time", "q", "qd", "qdd", "T_world_base", "base_twist", "base_acceleration", "com", "zmp", "margin"]
FEW, MANY = 25, 10_000


class Played:
    """A walk with its table and verdict in a folder, and the frames that ``send`` makes of it.

    The verdict is one on rigid servos, or on the table's, which are sent commands that allow for them.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self.path, self.table = folder, folder / "trajectory.npz", folder / "mine.toml"
        shutil.copy(find_robot("bioloid"), self.table)
        self.text = self.table.read_text(encoding="utf-8")
        self.walk = sk.walk(sk.load_robot(self.table), sk.load_gait("smooth"), steps=1)
        self.walk.save(self.path)
        self.file = self.path.read_bytes()
        self.verdicts = {servo: passing_data(self.path, servo) for servo in ("rigid", "table")}
        self.played = {servo: self.ticks_on(servo) for servo in self.verdicts}
        assert np.abs(self.played["table"] - self.played["rigid"]).max() > 2
        self.on("rigid")

    def ticks_on(self, servo: str) -> np.ndarray:
        """What is played after a verdict on such servos."""
        self.verdict = self.verdicts[servo]
        self.restore()
        return self.ticks_of(ready(self.path))

    def on(self, servo: str) -> None:
        """From now on the verdict is one on such servos."""
        self.servo, self.verdict, self.ticks = servo, self.verdicts[servo], self.played[servo]
        self.restore()

    def restore(self) -> None:
        """All as it was validated."""
        self.path.write_bytes(self.file)
        self.table.write_text(self.text, encoding="utf-8")
        self.judge(self.verdict)

    def judge(self, data: dict[str, Any]) -> None:
        (self.folder / "validation.json").write_text(json.dumps(data), encoding="utf-8")

    def ticks_of(self, may: Ready) -> np.ndarray:
        return may.bounds.ticks(may.frames.q)

    def check(self, what: str) -> None:
        """The forged folder is refused, or plays the same."""
        refused: ScrewkinError | None = None
        try:
            ticks = self.ticks_of(ready(self.path))
        except ScrewkinError as error:
            refused = error
        if refused is not None:
            assert refused.exit_code == 4, f"{what}: {refused}"
            assert len(str(refused)) > 20
            return
        frames = max(len(ticks), len(self.ticks))  # the last frame is held
        own, was = (np.pad(t, ((0, frames - len(t)), (0, 0)), mode="edge") for t in (ticks, self.ticks))
        assert frames <= len(self.ticks) + 1, what
        assert np.abs(own - was).max() <= 1, f"{what} is played, and is another walk"


@pytest.fixture(scope="module")
def played(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Played]:
    """A robot read twice from the same text is the same object, so that its programs are traced once."""
    known: dict[tuple[str, Any], sk.Robot] = {}

    def once(key: tuple[str, Any], read: Callable[[Any], sk.Robot], source: Any) -> sk.Robot:
        if key not in known:
            if len(known) > 8:
                known.clear()
            known[key] = read(source)
        return known[key]

    def loaded(source: str | Path) -> sk.Robot:
        path = Path(source)
        return once((str(source), path.read_bytes() if isfile(path) else None), sk.load_robot, source)

    def recorded(trajectory: Trajectory) -> sk.Robot:
        return once(("recorded", str(trajectory.meta["robot"])), recorded_robot, trajectory)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(readiness, "load_robot", loaded)
        patch.setattr(verdicts, "recorded_robot", recorded)
        yield Played(tmp_path_factory.mktemp("played"))


def changed_trajectory(played: Played, draw: st.DataObject) -> tuple[Trajectory, str]:
    """The walk with one field changed: an entry, a column, a stretch or all of it."""
    walk = played.walk
    tips = [f"T_world_tip.{tip}" for tip in walk.T_world_tip]
    name = draw.draw(st.sampled_from([*ARRAYS, *tips, "contact", "joint_names", "feet", "meta"]), "field")
    if name == "contact":
        i, k = draw.draw(st.integers(0, walk.samples - 1)), draw.draw(st.integers(0, 1))
        contact = walk.contact.copy()
        contact[i:, k] = ~contact[i:, k]
        return replace(walk, contact=contact), f"contact of foot {k} from sample {i} on"
    if name in ("joint_names", "feet"):
        order = draw.draw(st.permutations(getattr(walk, name)))
        return replace(walk, **{name: tuple(order)}), f"{name} {order}"
    if name == "meta":
        key = draw.draw(st.sampled_from(sorted(walk.meta["robot"])))
        text = draw.draw(st.sampled_from(["", "bioloid", "/nowhere.toml", walk.meta["robot"]["table"] + " "]))
        robot = {**walk.meta["robot"], key: text}
        return replace(walk, meta={**walk.meta, "robot": robot}), f"meta's robot {key} {text[:20]}"
    tip = name.partition(".")[2]
    array = np.array(walk.T_world_tip[tip] if tip else getattr(walk, name))
    size = 10.0 ** draw.draw(st.floats(-12, 3), "size") * draw.draw(st.sampled_from([-1, 1]))
    first = draw.draw(st.integers(0, len(array) - 1))
    last = draw.draw(st.integers(first + 1, len(array)))
    columns: Any = slice(None)
    if array.ndim > 1 and draw.draw(st.booleans()):
        columns = draw.draw(st.integers(0, array.shape[1] - 1))
    place: Any = (slice(first, last), columns) if array.ndim > 1 else slice(first, last)
    how = draw.draw(st.sampled_from(["add", "scale", "set", "ramp", "bump"]), "how")
    share = np.linspace(0.0, 1.0, last - first).reshape(-1, *[1] * (array[place].ndim - 1))
    array[place] = {
        "add": array[place] + size,
        "scale": array[place] * (1 + size),
        "set": size + 0 * array[place],
        "ramp": array[place] + size * share,
        "bump": array[place] + size * (16 * share**2 * (1 - share) ** 2),
    }[how]
    value = {**walk.T_world_tip, tip: array} if tip else array
    return replace(walk, **{name.partition(".")[0]: value}), f"{how} {size:g} to {name} {place}"


def check_trajectory(played: Played, draw: st.DataObject) -> None:
    try:
        forged, what = changed_trajectory(played, draw)
    except ScrewkinError:
        return  # no trajectory at all
    forged.save(played.path)
    try:
        with np.errstate(all="ignore"):
            played.judge(passing_data(played.path, played.servo))
    except ScrewkinError:
        played.judge(played.verdict | {"trajectory_sha256": load_trajectory(played.path).sha256})
    try:
        played.check(what)
    finally:
        played.restore()


VALUES = st.recursive(
    st.none() | st.booleans() | st.floats() | st.integers(-5, 5) | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=5,
)


def check_verdict(played: Played, draw: st.DataObject) -> None:
    """Another value in a field of the verdict, or one level below."""
    data = json.loads(json.dumps(played.verdict))
    key = draw.draw(st.sampled_from(sorted(data)), "field")
    inner = data[key]
    if isinstance(inner, dict) and inner and draw.draw(st.booleans()):
        inner[draw.draw(st.sampled_from(sorted(inner)))] = draw.draw(VALUES, "value")
    else:
        data[key] = draw.draw(VALUES, "value")
    try:
        played.judge(data)
        played.check(f"verdict {key}")
    finally:
        played.restore()


def check_table(played: Played, draw: st.DataObject) -> None:
    """One character of the table file is another one, more, or gone."""
    text = played.text
    i = draw.draw(st.integers(0, len(text) - 1), "place")
    put = draw.draw(st.sampled_from(["", text[i] * 2, "7", "-", ".", "#", " ", "\n"]), "put")
    if put == text[i]:
        return
    try:
        played.table.write_text(text[:i] + put + text[i + 1 :], encoding="utf-8", newline="")
        with pytest.raises(ScrewkinError) as refused:
            ready(played.path)
        assert refused.value.exit_code in (2, 4), "2 where it is no table any more"
    finally:
        played.restore()


CHECKS = {"trajectory": check_trajectory, "verdict": check_verdict, "table": check_table}
SERVOS = {"rigid": tuple(CHECKS), "table": ("trajectory", "verdict")}
CASES = [(servo, what) for servo, checks in SERVOS.items() for what in checks]


@pytest.mark.parametrize(("servo", "what"), CASES)
def test_nothing_that_changes_what_is_played_passes(played: Played, servo: str, what: str) -> None:
    explored(played, servo, what, FEW)


@pytest.mark.slow
@pytest.mark.parametrize(("servo", "what"), CASES)
def test_nothing_in_ten_thousand_changes_passes(played: Played, servo: str, what: str) -> None:
    explored(played, servo, what, MANY // len(CASES) + 1)


def explored(played: Played, servo: str, what: str, runs: int) -> None:
    played.on(servo)

    @settings(max_examples=runs, deadline=None, database=None, suppress_health_check=[HealthCheck.too_slow])
    @given(draw=st.data())
    def explore(draw: st.DataObject) -> None:
        CHECKS[what](played, draw)

    explore()


def test_every_field_of_the_file_is_changed() -> None:
    others = {"T_world_tip", "contact", "joint_names", "feet", "meta", "_file_sha256"}
    assert {f.name for f in fields(Trajectory)} == {*ARRAYS, *others}
