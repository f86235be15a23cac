"""The assets that pages share, and data inside a page."""

import base64
import gzip
import json

import pytest

from mutator import web
from mutator.web.html_templates import html_environment

PAGES = ("comparison", "golden", "report", "review", "serve", "trial")


def test_embedded_data_round_trip_and_are_reproducible() -> None:
    """Base64 cannot end a script element."""
    value = {"text": "</script> ⟨1⟩", "numbers": [0.1, None, 3]}
    text = web.pack_json(value)
    assert json.loads(gzip.decompress(base64.b64decode(text))) == value
    assert text == web.pack_json(value)
    assert web.packed_script_element(value, "here") == (
        f'<script type="application/octet-stream+gzip" id="here">{text}</script>'
    )


def test_plain_data_cannot_end_their_element() -> None:
    element = web.json_script_element({"text": "</script><!--"}, "here")
    assert element.count("<") == 2
    text = element.removeprefix('<script type="application/json" id="here">').removesuffix("</script>")
    assert json.loads(text) == {"text": "</script><!--"}


def test_nan_is_refused() -> None:
    """A page cannot read NaN in JSON."""
    with pytest.raises(ValueError, match="JSON"):
        web.pack_json([float("nan")])


@pytest.mark.parametrize("name", [*web.asset_names(".css"), *web.asset_names(".js")])
def test_assets_stay_small_and_cannot_end_their_element(name: str) -> None:
    assert len(web.asset_text(name).splitlines()) <= 300


def test_load_orders_name_every_script_once() -> None:
    """Pages of the server load some files by their addresses. Report panels add their own styles."""
    orders = [web.load_order(page, ".js") for page in PAGES]
    assert all(len({*order}) == len(order) for order in orders)
    assert {name for order in orders for name in order} == {*web.asset_names(".js")} - {
        "serve/start.js",
        "serve/runs.js",
        "serve/live.js",
        "report/defences.js",  # of a panel, like the style sheets below
    }
    styles = {name for page in PAGES for name in web.load_order(page, ".css")}
    assert styles == {*web.asset_names(".css")} - {
        "report/defences.css",
        "report/source.css",
        "serve/live.css",
    }


def test_pages_share_one_head() -> None:
    """It escapes the title, and has a policy only if the page sets one."""
    template = html_environment().from_string(
        '{% set title %}{{ name }} - page{% endset %}\n{% include "shared/head.html" %}\n</head>\n'
    )
    page = template.render(name="a < b", styles=["x{}"])
    assert page.startswith("<!doctype html>\n<html lang")
    assert "<title>a &lt; b - page</title>\n<style>\nx{}</style>\n</head>" in page
    assert "Content-Security-Policy" not in page
    assert '<meta http-equiv="Content-Security-Policy" content="none">' in template.render(
        name="", styles=[], policy="none"
    )
