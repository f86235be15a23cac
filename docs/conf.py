"""The documentation site: `sphinx-build -c docs . build/site`, or `tox -e docs`.

The pages are the Markdown files that a code host also shows, so the source folder is the clone itself. The
tables of docs/README.md are the navigation.
"""

import re
import shutil
from pathlib import Path

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.util import logging

from mutator import __version__

CLONE = Path(__file__).resolve().parents[1]
SOURCES = ("README.md", "CHANGELOG.md", "CONTRIBUTING.md", "benchmarks", "docs", "examples")

project = "mutator"
author = copyright = "the mutator authors"
release = __version__

extensions = ["myst_nb"]
root_doc = "docs/README"
exclude_patterns = [path.name for path in CLONE.iterdir() if path.name not in SOURCES]
exclude_patterns += ["examples/*/runs"]

myst_heading_anchors = 6
myst_enable_extensions = ["html_image"]
nb_execution_mode = "off"

highlight_language = "none"  # for blocks without a language

html_theme = "furo"
pygments_dark_style = "github-dark"
html_title = project
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_copy_source = False
html_additional_pages = {"index": "redirect.html"}
templates_path = ["_templates"]

LINK = re.compile(r"\[([^]]+)\]\(([^)#:\s]+\.(?:md|ipynb))\)")
RAW_IMAGE = re.compile(r'\b(?:src|srcset)="([^":]+)"')


def add_navigation(app: Sphinx, docname: str, source: list[str]) -> None:
    """Append to the front page a table of contents for each section, made from the section's links."""
    if docname == app.config.root_doc:
        for title, body in re.findall(r"^## (.+)\n((?:(?!## ).*\n?)*)", source[0], re.MULTILINE):
            pages = "\n".join(f"{text} <{page}>" for text, page in LINK.findall(body))
            source[0] += f"\n\n```{{toctree}}\n:hidden:\n:caption: {title}\n\n{pages}\n```\n"


def copy_raw_images(app: Sphinx, doctree: nodes.document) -> None:
    """Copy images of raw HTML such as `<picture>`, because Sphinx does not."""
    page = Path(app.env.doc2path(app.env.docname))
    for node in doctree.findall(nodes.raw):
        for name in RAW_IMAGE.findall(node.astext()):
            file = (page.parent / name).resolve()
            if file.is_file() and file.is_relative_to(CLONE):
                copied = Path(app.outdir) / file.relative_to(CLONE)
                copied.parent.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(file, copied)
            else:
                logging.getLogger(__name__).warning("no image %s", name, location=node)


def setup(app: Sphinx) -> None:
    app.connect("source-read", add_navigation)
    app.connect("doctree-read", copy_raw_images)
