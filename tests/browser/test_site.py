"""The documentation site, built with warnings as errors and opened from its files in Chromium."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

CLONE = Path(__file__).parents[2]
WIDE, NARROW = 1400, 390
FOUND = {  # what a newcomer types, and the page that answers
    "install": "docs/tutorial/first-campaign",
    "radar": "docs/tutorial/first-fault",
    "ghost": "docs/reference/fault-models",
    "own controller": "docs/tutorial/your-own-controller",
    "resume": "docs/how-to/resume",
    "hazard": "docs/how-to/add-a-hazard",
    "exit code": "docs/reference/cli",
    "seal": "docs/how-to/audit-a-run",
    "Slurm": "docs/how-to/run-on-many-machines",
    "seed": "docs/how-to/repeat-with-other-seeds",
    "notebook": "docs/how-to/use-in-a-notebook",
    "glossary": "docs/explanation/concepts",
    "load_run": "docs/reference/api",
    "film": "docs/how-to/film-an-experiment",
}
SHOWN = 5  # results visible without scrolling
OVERFLOW = "document.documentElement.scrollWidth - document.documentElement.clientWidth"

pytestmark = pytest.mark.slow


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    for package in ("sphinx", "furo", "myst_nb"):
        pytest.importorskip(package, reason="extra `docs` is not installed")
    out = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-n", "-c", "docs", "-d"]
    done = subprocess.run(
        [*command, str(out / "doctrees"), ".", str(out / "html")],
        cwd=CLONE,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return out / "html"


@pytest.fixture
def visited(browser: Any) -> Iterator[Any]:
    context = browser.new_context(reduced_motion="reduce")
    page, wrong = context.new_page(), []
    page.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("requestfailed", lambda request: wrong.append(f"failed: {request.url}"))
    page.on("request", lambda r: None if r.url.startswith(("file:", "data:")) else wrong.append(r.url))
    yield page
    context.close()
    assert wrong == []


@pytest.mark.parametrize("width", [WIDE, NARROW])
def test_every_page_works_when_opened_from_its_file(site: Path, visited: Any, width: int) -> None:
    # index.html only redirects
    pages = sorted(page for page in site.rglob("*.html") if page != site / "index.html")
    assert len(pages) > 60
    visited.set_viewport_size({"width": width, "height": 900})
    wider = {}
    for page in pages:
        visited.goto(page.as_uri())
        if over := visited.evaluate(OVERFLOW):
            wider[page.relative_to(site).as_posix()] = over
    assert wider == {}


def test_index_html_leads_to_the_readme(site: Path, visited: Any) -> None:
    visited.goto((site / "index.html").as_uri())
    visited.wait_for_url("**/docs/README.html")
    links = "all => all.map((a) => new URL(a.href).pathname)"
    listed = set(visited.eval_on_selector_all(".sidebar-tree a", links))
    made_by_sphinx = {site / f"{name}.html" for name in ("docs/README", "genindex", "index", "search")}
    assert listed == {str(page) for page in {*site.rglob("*.html")} - made_by_sphinx}


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("page", ["README", "docs/README", "docs/reference/api", "docs/tutorial/first-fault"])
def test_pages_are_accessible(
    site: Path, browser: Any, page: str, scheme: str, serious_faults: Callable[[Any], list[str]]
) -> None:
    shown = browser.new_page(color_scheme=scheme, reduced_motion="reduce")
    shown.goto((site / f"{page}.html").as_uri())
    assert serious_faults(shown) == []
    shown.close()


def test_search_finds_what_newcomers_look_for(site: Path, visited: Any) -> None:
    missed = {}
    for words, page in FOUND.items():
        visited.goto(f"{(site / 'search.html').as_uri()}?q={words}")
        visited.wait_for_selector("#search-results .search-summary:has-text('found')")
        links = "all => all.map((a) => a.getAttribute('href').split('.html')[0])"
        found = visited.eval_on_selector_all("#search-results .search li > a", links)
        if page not in list(dict.fromkeys(found))[:SHOWN]:
            missed[words] = found
    assert missed == {}


def test_a_console_block_is_copied_without_prompts_and_output(site: Path, visited: Any) -> None:
    visited.context.grant_permissions(["clipboard-read", "clipboard-write"])
    visited.goto((site / "docs" / "tutorial" / "first-campaign.html").as_uri())
    copied = []
    for blocks in (".highlight-console", "[class^=highlight-]:not(.highlight-console)"):
        block = visited.locator(blocks).first
        block.hover()
        block.locator("button.copy").click()
        block.locator("button.copy:has-text('Copied')").wait_for()
        copied.append(visited.evaluate("navigator.clipboard.readText()"))
    assert copied[0] == "mutator list specs\n"
    assert copied[1] == block.locator("pre").inner_text()
