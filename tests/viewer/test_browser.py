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
from pathlib import Path

import pytest

CHECKOUT = Path(__file__).resolve().parents[2]
PATIENCE = 120_000
"""How long one waits for anything [ms]: pictures are drawn by the processor here."""
URDF = """<robot name="pole">
<link name="foot"><visual><geometry><mesh filename="rod.stl"/></geometry></visual>
<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<link name="arm"><visual><origin xyz="0 0 0.1"/><geometry><mesh filename="rod.stl"/></geometry></visual>
<inertial><mass value="1"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="elbow" type="revolute"><parent link="foot"/><child link="arm"/><origin xyz="0 0 0.2"/>
<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
</robot>"""
pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def chromium():
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(
            executable_path=shutil.which("chromium"),
            args=["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
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


def reads(page, pattern):
    """The first text of the page that fits a pattern, waited for."""
    script = "pattern => new RegExp(pattern).test(document.body.innerText)"
    page.wait_for_function(script, arg=pattern, polling=500)
    return re.search(pattern, page.inner_text("body"))


def tab(page, name):
    page.get_by_role("tab", name=name).click(force=True)


def drag(page, label, share):
    """Drag the slider of a label to a share of its range, as a hand does."""
    row = page.locator(f"label:text-is('{label}')").locator("xpath=ancestor::*[.//*[@role='slider']][1]")
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


def test_a_walk_plays_and_another_stride_is_planned(page):
    with viewing("bioloid", "--steps", "2") as url:
        page.goto(url)
        reads(page, r"planned: [\d.]+ m in [\d.]+ s, margin at least [\d.]+ mm")
        first = reads(page, r"ZMP x (-?[\d.]+) mm, y -?[\d.]+ mm; margin [\d.]+ mm; t 0\.00 s")
        page.get_by_role("button", name="play", exact=True).click(force=True)
        later = reads(page, r"ZMP x (-?[\d.]+) mm, y -?[\d.]+ mm; margin [\d.]+ mm; t [1-9][\d.]* s")
        assert float(later[1]) > float(first[1])
        assert coloured(page)
        before = reads(page, r"planned: ([\d.]+) m in")[1]
        tab(page, "gait")
        drag(page, "stride [m]", 0.2)
        after = reads(page, rf"planned: (?!{re.escape(before)} )([\d.]+) m in")[1]
        assert float(after) < float(before), "shorter steps"


def test_a_linkage_follows_the_joint_that_is_dragged(page):
    with viewing("linkages/four-bar") as url:
        page.goto(url)
        tab(page, "joints")
        rocker = page.locator("label:text-is('rocker [rad]')")
        row = rocker.locator("xpath=ancestor::*[.//*[@role='slider']][1]")
        was = row.locator("input").first.input_value()
        drag(page, "crank [rad]", 0.75)
        page.wait_for_timeout(3000)
        assert row.locator("input").first.input_value() != was


def test_a_urdf_is_shown_with_its_meshes(page, tmp_path):
    import trimesh

    trimesh.creation.box((0.05, 0.05, 0.2)).export(tmp_path / "rod.stl")
    (tmp_path / "pole.urdf").write_text(URDF, encoding="utf-8")
    with viewing(tmp_path / "pole.urdf") as url:
        page.goto(url)
        reads(page, "no motion yet")
        page.wait_for_timeout(4000)
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
