"""The notes of a report's panels, as HTML."""

from mutator.report.panel import marked


def test_a_note_is_escaped_and_its_marks_are_elements() -> None:
    """Code and emphasis become elements. A single asterisk and all other text stay text."""
    assert marked("*above x* and `any`, marked with *.") == (
        "<em>above x</em> and <code>any</code>, marked with *."
    )
    assert marked("2 * 3 * 4 < `<b>`") == "2 * 3 * 4 &lt; <code>&lt;b&gt;</code>"
