"""The notes of a report's panels, as HTML."""

from mutator.report.panel import render_note


def test_code_and_emphasis_become_elements_and_the_rest_is_escaped() -> None:
    assert render_note("*above x* and `any`, marked with *.") == (
        "<em>above x</em> and <code>any</code>, marked with *."
    )
    assert render_note("2 * 3 * 4 < `<b>`") == "2 * 3 * 4 &lt; <code>&lt;b&gt;</code>"
