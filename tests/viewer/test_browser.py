"""Viewer and page in a headless Chromium: play, drag a joint, change the stride, read the ZMP; offline pages.

Left out by default; they need Debian's chromium, playwright and viser:

    python -m pytest -m browser
"""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
PATIENCE = 120_000
"""How long one waits for anything [ms]: pictures are drawn by the processor here."""
pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def chromium():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", "--enable-unsafe-swiftshader"],
        )
        yield browser
        browser.close()


@pytest.fixture
def page(chromium):
    page = chromium.new_page(viewport={"width": 800, "height": 600})
    page.set_default_timeout(PATIENCE)
    yield page
    page.close()


@contextmanager
def viewing(what, *words):
    """The address at which the real command shows something; it must end on an interrupt, with 130."""
    process = subprocess.Popen(
        [sys.executable, "-m", "screwkin", "view", str(what), "--json", "--port", "8350", *words],
        env={**os.environ, "PYTHONPATH": str(CHECKOUT), "OMP_NUM_THREADS": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        text = ""
        while process.poll() is None and not text.rstrip().endswith("}"):
            text += process.stdout.readline()
        yield json.loads(text)["url"]
    finally:
        process.send_signal(signal.SIGINT)
        _, error = process.communicate(timeout=60)
    said = [line for line in error.splitlines() if not line.startswith("remark: ")]
    assert (process.returncode, said) == (130, ["interrupted"])


def public_robots():
    """Files of robots with meshes: one of PyBullet's, and one of a folder named by ``SCREWKIN_ROBOTS``."""
    bullet = find_spec("pybullet_data")
    folders = list(bullet.submodule_search_locations or ()) if bullet else []
    files = [Path(folder) / "kuka_iiwa" / "model.urdf" for folder in folders]
    files.append(Path(os.environ.get("SCREWKIN_ROBOTS", "")) / "bolt_description" / "robots" / "bolt.urdf")
    return [file for file in files if file.is_file()]


def robot_of(what):
    """A robot by name or file."""
    import screwkin as sk

    return sk.load_robot(what)


def link_below(name, joint):
    """The link that a joint carries."""
    return next(each.child for each in robot_of(name).tree if each.name == joint)


def link_above(name, joint):
    """The link that carries a joint."""
    return next(each.parent for each in robot_of(name).tree if each.name == joint)


def reads(page, pattern):
    """The first text of the page that fits a pattern, waited for."""
    script = "pattern => new RegExp(pattern).test(document.body.innerText)"
    page.wait_for_function(script, arg=pattern, polling=500)
    return re.search(pattern, page.inner_text("body"))


def tab(page, name):
    page.get_by_role("tab", name=name).click(force=True)


def slider(page, label):
    """The row of a slider by its label, whose long words may be broken."""
    return page.locator(f"xpath=//label[.='{label}']/ancestor::*[.//*[@role='slider']][1]")


def drag(page, label, share):
    """Drag the slider of a label to a share of its range, as a hand does."""
    row = slider(page, label)
    row.scroll_into_view_if_needed()
    box = row.locator("[role=slider]").locator("xpath=..").bounding_box()
    thumb = row.locator("[role=slider]").bounding_box()
    y = thumb["y"] + thumb["height"] / 2
    page.mouse.move(thumb["x"] + thumb["width"] / 2, y)
    page.mouse.down()
    page.mouse.move(box["x"] + share * box["width"], y, steps=3)
    page.mouse.up()


def coloured(page):
    """Whether the picture shows more than paper and lines: pixels of a body's colour."""
    from io import BytesIO

    import numpy as np
    from PIL import Image

    with Image.open(BytesIO(page.screenshot(timeout=PATIENCE))) as shot:
        pixels = np.asarray(shot.convert("RGB"), float)[:, :450]
    return (np.ptp(pixels, axis=2) > 40).mean() > 0.003


def place(page, link):
    """Position of a link in the scene of the page itself, before its world is moved along with it."""
    data = page.evaluate("name => window.__viserMutable.nodePoseData[name]", f"/world/robot/{link}")
    return [*data["position"], *data["wxyz"]]


def moves(page, link, act):
    """Whether a link is elsewhere in the scene after something was done, waited for."""
    was = place(page, link)
    act()
    page.wait_for_function(
        """([name, was]) => { const at = window.__viserMutable.nodePoseData[name];
        return [...at.position, ...at.wxyz].some((x, i) => Math.abs(x - was[i]) > 1e-3); }""",
        arg=[f"/world/robot/{link}", was],
        polling=300,
    )
    return was, place(page, link)


def value(page, label):
    """The number beside a slider."""
    return float(slider(page, label).locator("input").first.input_value())


def opened(page, url):
    """The page with its scene put up."""
    page.goto(url)
    page.wait_for_function("window.__viserMutable?.nodePoseData['/world/floor']", polling=300)


def test_a_walk_plays_and_another_stride_is_planned(page):
    with viewing("bioloid", "--steps", "2") as url:
        opened(page, url)
        reads(page, r"planned: [\d.]+ m in [\d.]+ s, margin at least [\d.]+ mm")
        first = reads(page, r"ZMP x (-?[\d.]+) mm, y -?[\d.]+ mm; margin [\d.]+ mm; t 0\.00 s")
        play = page.get_by_role("button", name="play", exact=True)
        moves(page, "right_foot_link", lambda: play.click(force=True))
        later = reads(page, r"ZMP x (-?[\d.]+) mm, y -?[\d.]+ mm; margin [\d.]+ mm; t [1-9][\d.]* s")
        assert float(later[1]) > float(first[1])
        assert coloured(page)
        before = reads(page, r"planned: ([\d.]+) m in")[1]
        tab(page, "gait")
        drag(page, "stride [m]", 0.2)
        after = reads(page, rf"planned: (?!{re.escape(before)} )([\d.]+) m in")[1]
        assert float(after) < float(before), "shorter steps"


def test_the_joint_of_a_robot_is_dragged_and_what_it_carries_moves(page):
    with viewing("bioloid", "--steps", "1") as url:
        opened(page, url)
        reads(page, "margin at least")
        tab(page, "joints")
        below, above = link_below("bioloid", "right_knee"), link_above("bioloid", "right_knee")
        stays = place(page, above)
        was, now = moves(page, below, lambda: drag(page, "right_knee [rad]", 0.9))
        assert was != now
        assert place(page, above) == stays
        home = page.get_by_role("button", name="back home")
        moves(page, below, lambda: home.click(force=True))


def test_a_linkage_follows_the_joint_that_is_dragged(page):
    with viewing("linkages/four-bar") as url:
        opened(page, url)
        tab(page, "joints")
        was = value(page, "rocker [rad]")
        moves(page, link_below("linkages/four-bar", "rocker"), lambda: drag(page, "crank [rad]", 0.75))
        assert value(page, "rocker [rad]") != was


@pytest.mark.parametrize("file", public_robots(), ids=lambda file: file.name)
def test_an_imported_robot_is_shown_with_its_meshes_and_its_joints_are_dragged(page, file):
    with viewing(file) as url:
        opened(page, url)
        assert len(page.evaluate("Object.keys(window.__viserMutable.nodePoseData)")) > 10
        page.wait_for_timeout(4000)
        assert coloured(page)
        joint = next(joint for joint in robot_of(file).joints if joint.type == "revolute")
        tab(page, "joints")
        moves(page, joint.child, lambda: drag(page, f"{joint.name} [rad]", 0.8))


def test_axes_frames_and_circuits_are_put_up_on_demand(page):
    with viewing("bioloid", "--steps", "1") as url:
        opened(page, url)
        reads(page, "margin at least")
        tab(page, "show")
        names = "Object.keys(window.__viserMutable.nodePoseData).join(' ')"
        assert "/axis " not in page.evaluate(names)
        for label, part in (("screw axes", "/axis right_knee"), ("frames", "/frame right_foot")):
            page.get_by_label(label, exact=True).click(force=True)
            page.wait_for_function(f"{names}.includes('{part}')", polling=300)
        page.get_by_label("circuit").click(force=True)
        page.get_by_role("option", name="right_leg").click(force=True)
        page.wait_for_function(f"{names}.includes('/world/circuit/real')", polling=300)
        assert coloured(page)


@pytest.mark.parametrize("width", [380, 1000])
def test_a_page_from_a_file_plays_offline_and_fits_a_narrow_screen(page, tmp_path, width):
    from screwkin.cli import run

    asked = []
    page.on("request", lambda request: asked.append(request.url))
    page.set_viewport_size({"width": width, "height": 700})
    words = ["walk", "bioloid", "--gait", "paper", "--steps", "1", "-o", str(tmp_path)]
    assert run(words) == 0
    url = (tmp_path / "report.html").as_uri()
    page.goto(url)
    page.wait_for_selector("#player:not([hidden])")
    assert page.inner_text("#player-clock") == "0.00 s"
    page.locator("#player-play").click(force=True)
    page.wait_for_function(
        "parseFloat(document.getElementById('player-clock').textContent) > 0.2", polling=300
    )
    assert re.match(r"ZMP x -?[\d.]+ mm, y -?[\d.]+ mm, margin [\d.]+ mm", page.inner_text("#player-reading"))
    page.locator("#player-play").click(force=True)
    stopped = page.inner_text("#player-clock")
    time.sleep(1)
    assert page.inner_text("#player-clock") == stopped
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.evaluate("document.getElementById('player-without').hidden"), "the robot is drawn"
    assert asked == [url]
