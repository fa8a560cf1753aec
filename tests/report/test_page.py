"""The page: whole, self-contained, honest about its verdict, and safe against what names hold."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser
from io import BytesIO

import numpy as np
import pytest
from PIL import Image

import screwkin as sk
from screwkin.errors import OutputError
from screwkin.report.names import PICTURES, SIMULATED, remove_reports, remove_simulated
from screwkin.report.page import write_page
from screwkin.report.pictures import Saved, save_pictures

VOID = {"meta", "img", "br", "link", "input", "hr"}


class Reader(HTMLParser):
    """Checks that tags are balanced, and gathers text and references."""

    def __init__(self, text):
        super().__init__()
        self.open, self.text, self.references = [], [], []
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)
        self.references += [value for name, value in attrs if name in ("src", "href")]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text.append(data)

    @property
    def words(self):
        return re.sub(r"\s+", " ", " ".join(self.text))


@pytest.fixture(scope="module")
def pictures(account, tmp_path_factory):
    return save_pictures(account, tmp_path_factory.mktemp("pictures"))


def page(path, *args, **options):
    return Reader(write_page(path, *args, **options).read_text(encoding="utf-8"))


def test_everything_is_inside(account, pictures, tmp_path):
    read = page(tmp_path / "report.html", account, pictures)
    assert len(read.references) == len(pictures)
    for picture, reference in zip(pictures, read.references, strict=True):
        kind, _, data = reference.partition(",")
        assert kind == "data:image/webp;base64"
        with Image.open(picture.path) as drawn, Image.open(BytesIO(base64.b64decode(data))) as shown:
            apart = np.abs(np.asarray(drawn.convert("RGB"), float) - np.asarray(shown.convert("RGB"), float))
        assert shown.size == drawn.size
        assert apart.mean() < 2.0, "the same picture, in fewer bytes"
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"https?://|@import|<script src|<link", text)
    assert len(text) < 1.3e6
    assert all(re.search(r'alt="[^"]+"', tag) for tag in re.findall(r"<img[^>]*>", text))


def test_the_verdict_comes_first_then_numbers_pictures_robot_gait_and_making(account, pictures, tmp_path):
    words = page(tmp_path / "report.html", account, pictures).words
    order = [
        "bioloid: gait paper, 4 steps",
        "Balanced on paper",
        "smallest margin of the ZMP",
        "Seen from above",
        "1.7000 kg",
        "waist_height",
        "screwkin walk bioloid --gait paper",
        account.trajectory.sha256,
    ]
    places = [words.find(part) for part in order]
    assert -1 not in places
    assert places == sorted(places)
    assert "Not simulated yet" in words


def test_a_tipping_walk_is_called_that(tipping, tmp_path):
    words = page(tmp_path / "report.html", tipping, []).words
    assert "The ZMP leaves the support polygon in" in words
    assert "Balanced on paper" not in words


def test_a_failed_simulation_tells_every_reason(account, check, tmp_path):
    words = page(tmp_path / "report.html", account, [], check).words
    assert "Not passed." in words
    assert all(reason in words for reason in check.reasons)
    passed = page(tmp_path / "report.html", account, [], replace(check, passed=True, reasons=())).words
    assert "Passed: the robot walks in simulation as planned." in passed


def test_fast_joints_are_told_once_although_plan_and_simulation_warn(robot, tmp_path):
    from screwkin.analysis.account import account_of
    from screwkin.analysis.validate import validate

    hasty = sk.walk(robot, sk.load_gait("walk").replace(Tc=0.5), steps=1)
    words = page(tmp_path / "r.html", account_of(robot, hasty), [], validate(robot, hasty, "kinematic")).words
    assert words.count("planned joint speed above the servo's") == 1


def test_a_film_is_named_and_lies_beside_the_page(account, tmp_path):
    (tmp_path / "walk.gif").write_bytes(b"GIF89a")
    read = page(tmp_path / "report.html", account, [], film=tmp_path / "walk.gif")
    assert read.references == []
    assert "beside this page: walk.gif" in read.words


def test_reports_of_earlier_results_are_removed_and_nothing_else(account, pictures, tmp_path):
    assert {picture.path.stem for picture in pictures} <= set(PICTURES)
    for name in ("report.html", "walk.gif", "margin.png", "mine.png", "trajectory.npz", "notes.html"):
        (tmp_path / name).write_bytes(b"old")
    assert set(remove_reports(tmp_path)) == {"report.html", "walk.gif", "margin.png"}
    assert {path.name for path in tmp_path.iterdir()} == {"mine.png", "trajectory.npz", "notes.html"}
    assert remove_reports(tmp_path) == ()


@pytest.mark.parametrize("simulated", [True, False])
def test_another_simulation_makes_untrue_what_shows_one_and_no_picture_of_the_plan(tmp_path, simulated):
    plan = {f"{name}.png" for name in PICTURES if name not in (*SIMULATED, "frames")}
    shows = {f"{name}.png" for name in SIMULATED} | {"walk.gif"} if simulated else set()
    for name in (*plan, *shows, "frames.png", "report.html"):
        (tmp_path / name).write_bytes(b"old")
    untrue = {"report.html", *shows} | ({"frames.png"} if simulated else set())
    assert set(remove_simulated(tmp_path)) == untrue
    assert {path.name for path in tmp_path.iterdir()} == plan | (set() if simulated else {"frames.png"})


def test_markup_in_names_is_text(account, robot, tmp_path):
    meta = {**account.trajectory.meta, "gait": {"gait": {"name": "paper", "Tc": "<u>1"}}}
    walked = replace(account.trajectory, meta=meta)
    named = replace(robot, description="a & $title")
    object.__setattr__(named, "name", "<b>x")  # which no table and no record may be called
    sly = replace(account, robot=named, trajectory=walked)
    caption = Saved(tmp_path / "p.png", "<i>", '"><script>')
    (tmp_path / "p.png").write_bytes(b"")
    read = page(tmp_path / "report.html", sly, [caption], commands=["screwkin walk '<x>'"])
    assert "<b>x: gait paper" in read.words
    assert "a & $title" in read.words
    assert "<u>1 s per step" in read.words
    assert "screwkin walk '<x>'" in read.words


def test_a_trajectory_that_tells_nothing_of_its_making_still_has_a_page(account, tmp_path):
    bare = replace(account, trajectory=replace(account.trajectory, meta={}))
    words = page(tmp_path / "report.html", bare, []).words
    assert "bioloid: gait unknown" in words
    assert "(not recorded)" in words


def test_a_page_that_cannot_be_written_leaves_nothing(account, tmp_path):
    with pytest.raises(OutputError, match=r"report\.html"):
        write_page(tmp_path / "absent" / "report.html", account, [])
    with pytest.raises(FileNotFoundError):
        write_page(tmp_path / "report.html", account, [Saved(tmp_path / "none.png", "a", "b")])
    assert list(tmp_path.iterdir()) == []
