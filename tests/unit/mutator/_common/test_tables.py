"""One table, three ways to show it."""

from mutator._common.tables import Table


def test_text_pads_columns_and_aligns_numbers_to_the_right() -> None:
    """Columns are as wide as their widest cell, and no line ends in spaces."""
    table = Table(heads=("fault", "runs"), rows=[("radar/chaff", "7"), ("fog", "12")], right=(1,))
    assert table.as_text().splitlines() == ["fault        runs", "radar/chaff     7", "fog            12"]


def test_a_table_without_rows_is_its_heads() -> None:
    """An empty table still says what it would list."""
    table = Table(heads=("a", "b"), rows=[])
    assert table.as_text() == "a  b"
    assert table.as_markdown() == "| a | b |\n|---|---|"
    assert "<tbody>\n</tbody>" in table.as_html()


def test_a_table_in_markdown_has_a_line_for_each_row() -> None:
    """Whatever ends a line, or would be taken for an element, italics or bold, in a cell is text."""
    lines = [["a\r\nb\rc"], ["<class 'float'>"], ["p < 0.05"], ["no *x* in __init__"], ["a * b_c_d * `_e`"]]
    assert Table(heads=["said"], rows=lines).as_markdown().splitlines()[2:] == [
        "| a b c |",
        "| &lt;class 'float'> |",
        "| p < 0.05 |",
        r"| no \*x\* in \_\_init\_\_ |",
        "| a * b_c_d * `_e` |",
    ]


def test_a_bar_in_a_cell_does_not_end_it() -> None:
    """A bar is escaped, unless the cells are Markdown already."""
    table = Table(heads=["x"], rows=[["a|b *c*"]])
    assert table.as_markdown().endswith(r"| a\|b \*c\* |")
    assert table.as_markdown(escape=False).endswith("| a|b *c* |")


def test_html_escapes_texts_and_marks_continued_rows() -> None:
    """A text is never an element, braces are text, and a row with an empty first cell has a class."""
    html = Table(heads=["<b>"], rows=[["<i> & {0}"], [""]]).as_html("plain")
    assert '<table class="plain">' in html
    assert '<th scope="col">&lt;b&gt;</th>' in html
    assert "<tr><td>&lt;i&gt; &amp; {0}</td></tr>" in html
    assert '<tr class="group"><td></td></tr>' in html
