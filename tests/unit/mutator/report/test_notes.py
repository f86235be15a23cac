"""The notes of a report's panels, as HTML."""

from mutator.report.panel import marked


def test_code_and_emphasis_become_elements_and_the_rest_is_escaped() -> None:
    assert marked("*above x* and `any`, marked with *.") == (
        "<em>above x</em> and <code>any</code>, marked with *."
    )
    assert marked("2 * 3 * 4 < `<b>`") == "2 * 3 * 4 &lt; <code>&lt;b&gt;</code>"
