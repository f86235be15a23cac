"""Measure the frame rate of an experiment's replay in a headless Chromium without a GPU.

`python benchmarks/replay.py [--seconds N]`. A synthetic run of the shipped target, with its scene and all of
its channels at 20 samples a second, plays on screens of several widths and pixel densities. The browser draws
at most 60 frames a second; the goal is 30.
"""

import argparse
import json
import os
import shutil
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from mutator.targets.manifest import TargetManifest
from mutator.targets.overhead_view_json import scene_as_json
from mutator.web import asset_text, load_order
from mutator.workspace import Workspace

GOAL = 30  # frames a second
DURATION, STEP = 30.0, 0.05  # s
SCREENS = {"400 px": (400, 1), "1000 px": (1000, 1), "1000 px, 2 dots each": (1000, 2), "2000 px": (2000, 1)}
FLAGS = ("--disable-gpu", "--no-first-run", "--disable-background-networking")
PAGE = """<!doctype html><meta charset="utf-8">{styles}<body><div id="place"></div>{scripts}<script>
const {{ series, facts }} = {data};
for (const channel of series.channels) {{
    channel.t = Float64Array.from(channel.t);
    for (const run of ["golden", "faulty"]) channel[run] = Float32Array.from(channel[run]);
}}
window.player = Replay.show(document.getElementById("place"), series, facts);
</script>"""


def made_series(manifest: TargetManifest) -> dict[str, Any]:
    """Return a run in which the fault makes every channel diverge from 5 s onwards."""
    t = np.arange(0.0, DURATION, STEP)
    made = {c.name: 0.1 * np.sin(t + i) for i, c in enumerate(manifest.channels)}
    made |= {
        "d_rel": 40 + 10 * np.sin(t / 3),
        "v_ego": 20 + np.sin(t / 5),
        "lead_d_rel": 45 + 10 * np.sin(t / 3),
    }
    channels = [
        {
            "name": c.name,
            "unit": c.unit,
            "role": c.role.value,
            "component": c.component,
            "about": c.about,
            "t": t.tolist(),
            "golden": made[c.name].tolist(),
            "faulty": (made[c.name] + 0.05 * np.maximum(0.0, t - 5.0) * np.sin(3 * t)).tolist(),
        }
        for c in manifest.channels
    ]
    marks = [["activation", 5.0, "activated"], ["manifest", 5.1, "manifested"], ["alert", 9.0, "fcw"]]
    return {"id": "0" * 16, "start": 0.0, "end": float(t[-1]), "tEnd": None, "active": [5.0, 20.0]} | {
        "marks": marks,
        "channels": channels,
    }


def frame_rate(browser: Any, page_file: Path, width: int, ratio: int, seconds: float) -> float:
    context = browser.new_context(
        viewport={"width": width, "height": 1000}, device_scale_factor=ratio, reduced_motion="no-preference"
    )
    page = context.new_page()
    page.goto(page_file.as_uri())
    page.click(".replay-player .play")
    page.wait_for_timeout(1000 * seconds)
    rate = float(page.evaluate("Replay.rate"))
    context.close()
    return rate


def main() -> int:
    from playwright.sync_api import sync_playwright

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=4.0, help="how long each screen plays")
    seconds = parser.parse_args().seconds
    path = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
    if path is None:
        parser.error("no browser here")
    manifest = Workspace.find().manifest("openpilot")
    data = {"series": made_series(manifest), "facts": {"scene": scene_as_json(manifest), "hazards": []}}
    replay = [name for name in load_order("report", ".js") if name.startswith(("shared/dom", "replay/"))]
    text = PAGE.format(
        styles="".join(f"<style>{asset_text(name)}</style>" for name in load_order("report", ".css")),
        scripts="".join(f"<script>{asset_text(name)}</script>" for name in replay),
        data=json.dumps(data).replace("<", "\\u003c"),
    )
    slowest = float("inf")
    flags = [*FLAGS, "--no-sandbox"] if os.geteuid() == 0 else [*FLAGS]
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        page_file = Path(folder) / "replay.html"
        page_file.write_text(text, encoding="utf-8")
        browser = playwright.chromium.launch(executable_path=path, args=flags)
        for name, (width, ratio) in SCREENS.items():
            rate = frame_rate(browser, page_file, width, ratio, seconds)
            slowest = min(slowest, rate)
            print(f"{name}: {rate:.0f} frames a second")
        browser.close()
    print(f"slowest: {slowest / GOAL:.1f} times the goal of {GOAL}")
    return 0 if slowest >= GOAL else 1


if __name__ == "__main__":
    raise SystemExit(main())
