"""python -m benchmarks.viewing [-o FILE.md]: how soon the viewer answers, and how many pictures it shows.

A walk plays in a headless Chromium that has no graphics card; beside it viser's own example with as many
meshes that move, as it comes and without shadows. A picture counts as another one where a matrix of the scene
differs from the picture before. Needs Debian's chromium, playwright and viser. On a busy machine,
``chrt -r 1 python -m benchmarks.viewing`` lets it go first.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median
from typing import Any

from benchmarks.machine import description, pin_threads

ROOT = Path(__file__).resolve().parents[1]
SECONDS, ROUNDS = 5.0, 3
MESHES = 19
"""Of viser's example: as many as the robot has links."""
FLAGS = ("--no-sandbox", "--enable-unsafe-swiftshader")
COUNT = """
window.pictures = {shown: 0, other: 0};
(() => {
  const gl = WebGL2RenderingContext.prototype;
  let drawn = false, sum = 0, before = 0;
  for (const name of ["drawElements", "drawArrays", "drawElementsInstanced", "drawArraysInstanced"]) {
    const own = gl[name];
    gl[name] = function (...given) { drawn = true; return own.apply(this, given); };
  }
  const own = gl.uniformMatrix4fv;
  gl.uniformMatrix4fv = function (place, turned, values, ...more) {
    for (let i = 0; i < 16; i++) sum = (sum * 31 + values[i] * 1e4) % 1e9;
    return own.call(this, place, turned, values, ...more);
  };
  const count = () => {
    if (drawn) {
      window.pictures.shown++;
      if (sum !== before) window.pictures.other++;
      before = sum; drawn = false; sum = 0;
    }
    requestAnimationFrame(count);
  };
  requestAnimationFrame(count);
})();
"""
Row = dict[str, Any]


def processor_time(pid: int) -> float:
    """Of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def pictures_processes() -> dict[int, str]:
    """Chromium's processes below this one, by number, with what each does."""
    kinds, parents = {}, {}
    for entry in Path("/proc").iterdir():
        try:
            pid, fields = int(entry.name), (entry / "stat").read_text().rsplit(")", 1)[1].split()
            words = (entry / "cmdline").read_bytes().decode(errors="replace")
        except (ValueError, OSError):
            continue
        parents[pid] = int(fields[1])
        if "chromium" in words and fields[0] != "Z":
            kinds[pid] = (re.search(r"--type=([\w-]+)", words) or [words, "browser"])[1]

    def below(pid: int) -> bool:
        return pid in parents and (parents[pid] == os.getpid() or below(parents[pid]))

    return {pid: kind for pid, kind in kinds.items() if below(pid)}


@contextmanager
def served(*words: str) -> Iterator[tuple[str, int, Row]]:
    """The address, process and times until ready of a command that prints a JSON with ``url``."""
    began = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-m", *words], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
    )
    assert process.stdout is not None
    text = ""
    while not text.rstrip().endswith("}") and process.poll() is None:
        text += process.stdout.readline()
    ready = {"wall_s": time.monotonic() - began, "processor_s": processor_time(process.pid)}
    try:
        yield json.loads(text[text.index("{") :])["url"], process.pid, ready
    finally:
        process.terminate()
        process.wait(20)


def until_ready(what: str) -> Row:
    """Median times of three starts until the address answers [s]."""
    times = []
    for _ in range(ROUNDS):
        with served("screwkin", "view", what, "--json", "--port", "8420") as (_, _, ready):
            times.append(ready)
    return {key: median(each[key] for each in times) for key in times[0]}


def planning_anew() -> Row:
    """Median times of a walk planned for another stride, with all it needs loaded [s]."""
    from screwkin.gait.files import load_gait
    from screwkin.model.table import load_robot
    from screwkin.viewer.session import begun, handled, replanned

    session = replanned(begun(load_robot("bioloid"), load_gait("walk")))
    walls, used = [], []
    for k in range(5):
        wall, own = time.monotonic(), time.process_time()
        session = handled(session, {"gait stride": 0.05 + 0.005 * k})
        walls.append(time.monotonic() - wall)
        used.append(time.process_time() - own)
    return {"wall_s": median(walls), "processor_s": median(used)}


def frames(browser: Any, *words: str) -> Row:
    """Pictures a second of what a command shows, and processor time of each picture by process [ms]."""
    with served(*words) as (url, server, _):
        page = browser.new_page(viewport={"width": 800, "height": 600})
        page.set_default_timeout(120_000)
        page.add_init_script(COUNT)
        page.goto(url)
        page.wait_for_function("window.pictures.shown > 2", polling=300)
        if words[0] == "screwkin":
            page.wait_for_function("/margin at least/.test(document.body.innerText)", polling=300)
        time.sleep(3.0)
        if words[0] == "screwkin":
            page.get_by_role("button", name="play", exact=True).click(force=True)
            time.sleep(0.5)
        names = {server: "server", **pictures_processes()}
        before, began = page.evaluate("({...window.pictures})"), time.monotonic()
        used = {pid: processor_time(pid) for pid in names}
        time.sleep(SECONDS)
        after, wall = page.evaluate("({...window.pictures})"), time.monotonic() - began
        spent: dict[str, float] = {}
        for pid, name in names.items():
            spent[name] = spent.get(name, 0.0) + processor_time(pid) - used[pid]
        page.close()
    shown, other = (after[key] - before[key] for key in ("shown", "other"))
    each = {f"{name}_ms": 1e3 * seconds / max(shown, 1) for name, seconds in spent.items()}
    return {"shown": shown / wall, "other": other / wall, **each}


def viser_example(shadows: bool) -> None:
    """As many boxes as a robot has links, moved 40 times a second by viser, until this is ended."""
    import numpy as np
    import viser

    server = viser.ViserServer(host="127.0.0.1", port=8440, verbose=False)
    if not shadows:
        server.scene.configure_default_lights(cast_shadow=False)
        server.scene.configure_environment_map(None)
    boxes = [
        server.scene.add_box(
            f"/{k}", dimensions=(0.05, 0.05, 0.1), cast_shadow=shadows, receive_shadow=shadows
        )
        for k in range(MESHES)
    ]
    print(json.dumps({"url": f"http://127.0.0.1:{server.get_port()}"}), flush=True)
    while os.getppid() != 1:
        t = time.monotonic()
        with server.atomic():
            for k, box in enumerate(boxes):
                box.position = (0.3 * np.sin(t + k), 0.3 * np.cos(t + k), 0.05 * k)
                box.wxyz = (np.cos(t), 0.0, 0.0, np.sin(t))
        time.sleep(1 / 40)


def page_of(starts: dict[str, Row], planning: Row, pictures: dict[str, Row]) -> str:
    """The results as Markdown."""
    machine = description(["viser", "playwright"])
    first = hasattr(os, "sched_getscheduler") and os.sched_getscheduler(0) == os.SCHED_RR
    others = f"load {machine['load']}" + (" of processes that had to wait (`chrt -r 1`)" if first else "")
    lines = [
        "# The viewer",
        "",
        f"`python -m benchmarks.viewing` on {machine['processor']}, {machine['cores']} cores, one-minute "
        f"{others}; no graphics card: Chromium draws by the processor (800 x 600). "
        f"Medians of {ROUNDS}.",
        "",
        "| ready | wall [s] | processor [s] |",
        "|---|---|---|",
        *(
            f"| `view {what}` | {row['wall_s']:.2f} | {row['processor_s']:.2f} |"
            for what, row in starts.items()
        ),
        f"| planning anew | {planning['wall_s']:.2f} | {planning['processor_s']:.2f} |",
        "",
        "| pictures a second | shown | another one | server [ms] | page [ms] | drawing [ms] |",
        "|---|---|---|---|---|---|",
    ]
    for name, row in pictures.items():
        parts = (row.get(f"{kind}_ms", 0.0) for kind in ("server", "renderer", "gpu-process"))
        lines.append(
            f"| {name} | {row['shown']:.1f} | {row['other']:.1f} | "
            + " | ".join(f"{part:.0f}" for part in parts)
            + " |"
        )
    return "\n".join([*lines, "", "Milliseconds are processor time for each picture.", ""])


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.viewing")
    parser.add_argument(
        "-o", type=Path, default=ROOT / "runs" / "benchmarks" / "viewing.md", metavar="FILE.md"
    )
    parser.add_argument("--example", choices=("plain", "bare"), help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.example:
        viser_example(asked.example == "plain")
        return
    from playwright.sync_api import sync_playwright

    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=shutil.which("chromium"), args=list(FLAGS))
        example = ("benchmarks.viewing", "--example")
        view = ("screwkin", "view", "bioloid", "--json", "--port", "8430")
        rounds: dict[str, list[Row]] = {}
        for _ in range(ROUNDS):
            for name, words in (
                ("`view bioloid`, playing", view),
                (f"viser, {MESHES} boxes", (*example, "plain")),
                ("the same without shadows and environment", (*example, "bare")),
            ):
                rounds.setdefault(name, []).append(frames(browser, *words))
        browser.close()
    pictures = {
        name: {key: median(row.get(key, 0.0) for row in rows) for key in rows[0]}
        for name, rows in rounds.items()
    }
    starts = {what: until_ready(what) for what in ("bioloid", "poppy12", "linkages/four-bar")}
    asked.o.parent.mkdir(parents=True, exist_ok=True)
    asked.o.write_text(page_of(starts, planning_anew(), pictures), encoding="utf-8")
    print(asked.o.read_text(encoding="utf-8"))


if __name__ == "__main__":
    pin_threads()
    main()
