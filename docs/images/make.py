"""Make the pictures of README and docs from two runs of a campaign, on two versions of the controller.

    mutator run quickstart --out runs/quickstart -n 2
    cp -r target runs/distant-target
    sed -i 's/^TIME_GAP = 1.8/TIME_GAP = 2.2/' runs/distant-target/selfdrive/controls/lib/long_ocp.py
    mutator run quickstart --target runs/distant-target --out runs/distant -n 2
    python docs/images/make.py runs/quickstart runs/distant

Each picture is made wide and narrow, light and dark, such as `report-wide-dark.png`. The film shows the worst
contact of the first run. The same runs give the same pictures, up to the shade of a few pixels.
The script needs the extra `test` and Chromium; it takes about a minute.
"""

import argparse
import contextlib
import io
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from math import ceil, floor
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

HERE = Path(__file__).parent
WIDTHS = {"wide": {"width": 1280, "height": 800}, "narrow": {"width": 390, "height": 780}}
SCHEMES = ("light", "dark")
NOON = "2026-01-01T12:00"
WORST_CONTACT = "[aria-labelledby=answer-dangerous] tr:has-text('delta-v') a[href^='#e=']"
STEPS = 2  # of 1/20 s, from one frame of a film to the next
FRAME_MS, LAST_MS, COLOURS, MARGIN = 100, 3000, 64, 4
INSTRUMENTS = ("v_ego", "d_rel", "gas", "brake")  # below the road in a film
SHOWN = ", ".join(f".gauge[aria-label='Plot of {name}']" for name in INSTRUMENTS)
# A film has no buttons to press, and nothing covers it.
FILM_STYLE = f"""
.replay-player .controls > :not(.legend), .gauge, .gauges .more {{ display: none !important }}
{SHOWN} {{ display: grid !important }}
.gauge {{ background: none !important; box-shadow: none !important }}
.replay-player :focus-visible {{ outline: none }}
#experiment > header {{ position: static }}
"""


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("run", type=Path, help="the run to show")
    parser.add_argument("other", type=Path, help="the run to compare it with")
    runs = parser.parse_args()
    with tempfile.TemporaryDirectory() as scratch, served(runs.run, runs.other) as address:
        pages = Path(scratch)
        mutator("review", "page", "--spec", "radar/*", "--out", str(pages / "review.html"))
        mutator("compare", str(runs.run), str(runs.other), "--out", str(pages / "comparison"))
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(
                executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
            )
            for width, size in WIDTHS.items():
                for scheme in SCHEMES:
                    page = browser.new_page(viewport=size, color_scheme=scheme, reduced_motion="reduce")
                    name = f"-{width}-{scheme}"
                    report(page, runs.run.resolve() / "report" / "index.html", name)
                    static(page, (pages / "review.html").as_uri(), "review" + name)
                    static(page, (pages / "comparison" / "index.html").as_uri(), "comparison" + name)
                    page.clock.set_fixed_time(NOON)  # a form suggests a name with the time
                    static(page, address, "serve" + name)
                    page.close()
            browser.close()


def mutator(*words: str) -> None:
    subprocess.run(command(*words), check=True, stdout=subprocess.DEVNULL)


def command(*words: str) -> list[str]:
    return [str(Path(sys.executable).parent / "mutator"), *words]


@contextlib.contextmanager
def served(*runs: Path) -> Iterator[str]:
    """Yield the address of a server of these runs."""
    words = command("serve", *map(str, runs), "--no-browser")
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as server:
        try:
            assert server.stdout
            found = next(filter(None, (re.search(r"http://\S+", line) for line in server.stdout)))
            yield found[0]
        finally:
            server.terminate()


def report(page: Any, path: Path, name: str) -> None:
    """Save the report's first screen, the worst experiment, and a film of its replay."""
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-ready]")
    page.wait_for_selector("#worst-replay .replay-player")
    save(page.screenshot(), "report" + name)
    page.locator(WORST_CONTACT).first.click()
    page.wait_for_selector("#experiment .replay-player")
    page.locator("#experiment .jumps button").last.click()
    page.mouse.move(0, 0)  # so that the pointer highlights nothing
    show(page, "#experiment .replay-player", below="#experiment > header")
    save(page.screenshot(), "experiment" + name)
    page.add_style_tag(content=FILM_STYLE)
    film(page, "replay" + name)


def static(page: Any, address: str, name: str) -> None:
    page.goto(address)
    page.wait_for_load_state("networkidle")
    save(page.screenshot(), name)


def show(page: Any, what: str, *, below: str) -> None:
    page.evaluate(
        """([what, below]) => {
            const found = document.querySelector(what), head = document.querySelector(below);
            found.style.scrollMarginTop = `${head.offsetHeight}px`;
            found.scrollIntoView();
        }""",
        [what, below],
    )


def film(page: Any, name: str) -> None:
    """Step the replay from one second before the activation to the last event, and save the frames."""
    end = time(page)
    page.locator("#experiment .jumps button").first.click()
    page.mouse.move(0, 0)
    page.locator("#experiment .timebar").focus()
    page.keyboard.press("Shift+ArrowLeft")
    show(page, "#experiment .stage", below="#experiment .jumps")
    clip = around(
        page.locator("#experiment .stage").bounding_box(), page.locator("#experiment .gauges").bounding_box()
    )
    frames = []
    while (now := time(page)) < end:
        frames.append(Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB"))
        for _ in range(STEPS):
            page.keyboard.press("ArrowRight")
        assert time(page) > now
    page.locator("#experiment .jumps button").last.press("Enter")
    time(page)
    frames.append(Image.open(io.BytesIO(page.screenshot(clip=clip))).convert("RGB"))
    column = Image.new("RGB", (frames[0].width, frames[0].height * len(frames)))
    for i, frame in enumerate(frames):
        column.paste(frame, (0, i * frame.height))
    palette = column.quantize(COLOURS, Image.Quantize.FASTOCTREE)
    few = [f.quantize(palette=palette, dither=Image.Dither.NONE).convert("RGB") for f in frames]
    times = [FRAME_MS] * (len(few) - 1) + [LAST_MS]
    path = HERE / f"{name}.webp"
    few[0].save(path, save_all=True, append_images=few[1:], duration=times, loop=0, lossless=True, method=6)
    print(path, path.stat().st_size)


def around(top: dict[str, float], bottom: dict[str, float]) -> dict[str, float]:
    """Return whole pixels around two boxes, one below the other."""
    x, y = floor(top["x"]) - MARGIN, floor(top["y"]) - MARGIN
    return {
        "x": x,
        "y": y,
        "width": ceil(top["x"] + top["width"]) + MARGIN - x,
        "height": ceil(bottom["y"] + bottom["height"]) + MARGIN - y,
    }


def time(page: Any) -> float:
    page.evaluate("new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))")
    return float(page.get_attribute("#experiment .replay-player", "data-t"))


def save(data: bytes, name: str) -> None:
    """Write a screenshot with few colours, which takes a quarter of the space."""
    path = HERE / f"{name}.png"
    Image.open(io.BytesIO(data)).convert("RGB").quantize(128).save(path, optimize=True)
    print(path, path.stat().st_size)


if __name__ == "__main__":
    main()
