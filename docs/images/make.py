"""Make the pictures of README from a run folder: `python docs/images/make.py RUN`.

It needs the extra `test` and Chromium. The experiment shown is the worst of the run.
"""

import argparse
import io
import shutil
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import sync_playwright

HERE = Path(__file__).parent
WIDE = {"width": 1280, "height": 800}
STEPS = 3  # of 1/20 s, that a picture of the film is later than the one before
PICTURES, FRAME_MS, LAST_MS, COLOURS = 120, 80, 2000, 64


def main() -> None:
    """Open the report of the run, and take its pictures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("run", type=Path)
    page_of = parser.parse_args().run.resolve() / "report" / "index.html"
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=shutil.which("chromium"), args=["--no-sandbox", "--disable-gpu"]
        )
        page = browser.new_page(viewport=WIDE, color_scheme="light")
        page.goto(page_of.as_uri())
        page.wait_for_selector("html[data-ready]")
        save(page.screenshot(), "report.png")
        page.locator("[aria-labelledby=answer-dangerous] a[href^='#e=']").first.click()
        page.wait_for_selector(".replay-player")
        page.locator(".timebar").focus()
        film(page)
        page.locator(".jumps button").last.click()
        save(page.screenshot(), "experiment.png")
        browser.close()


def film(page: Any) -> None:
    """Step the replay from shortly before the activation to the drive's end; keep what is seen."""
    stage = page.locator(".stage")
    pictures = []
    while len(pictures) < PICTURES and "after the end" not in stage.inner_text():
        pictures.append(Image.open(io.BytesIO(stage.screenshot())).convert("RGB"))
        for _ in range(STEPS):
            page.keyboard.press("ArrowRight")
    width, height = 640, round(640 * pictures[0].height / pictures[0].width)
    small = [one.resize((width, height), Image.Resampling.LANCZOS) for one in pictures]
    all_of_them = Image.new("RGB", (width, height * len(small)))
    for i, one in enumerate(small):
        all_of_them.paste(one, (0, i * height))
    palette = all_of_them.quantize(COLOURS, Image.Quantize.FASTOCTREE)
    small = [one.quantize(palette=palette, dither=Image.Dither.NONE) for one in small]
    path = HERE / "replay.gif"
    times = [FRAME_MS] * (len(small) - 1) + [LAST_MS]
    small[0].save(path, save_all=True, append_images=small[1:], duration=times, loop=0, optimize=True)
    print(path, path.stat().st_size)


def save(data: bytes, name: str) -> None:
    """Write a screenshot with few colours, which takes a quarter."""
    path = HERE / name
    Image.open(io.BytesIO(data)).convert("RGB").quantize(128).save(path, optimize=True)
    print(path, path.stat().st_size)


if __name__ == "__main__":
    main()
