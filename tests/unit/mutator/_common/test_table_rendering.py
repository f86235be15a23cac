"""Tables as text, Markdown and HTML."""

from markupsafe import Markup

from mutator._common.table_rendering import TextTable


def test_text_pads_columns_and_aligns_numbers_to_the_right() -> None:
    table = TextTable(heads=("fault", "runs"), rows=[("radar/chaff", "7"), ("fog", "12")], right_aligned=(1,))
    assert table.as_text().splitlines() == ["fault        runs", "radar/chaff     7", "fog            12"]


def test_a_table_without_rows_shows_its_headings() -> None:
    table = TextTable(heads=("a", "b"), rows=[])
    assert table.as_text() == "a  b"
    assert table.as_markdown() == "| a | b |\n|---|---|"
    assert "<tbody>\n</tbody>" in table.as_html()


def test_markdown_cells_stay_on_one_line_and_are_escaped() -> None:
    lines = [["a\r\nb\rc"], ["<class 'float'>"], ["p < 0.05"], ["no *x* in __init__"], ["a * b_c_d * `_e`"]]
    assert TextTable(heads=["said"], rows=lines).as_markdown().splitlines()[2:] == [
        "| a b c |",
        "| &lt;class 'float'> |",
        "| p < 0.05 |",
        r"| no \*x\* in \_\_init\_\_ |",
        "| a * b_c_d * `_e` |",
    ]


def test_a_vertical_bar_in_a_cell_is_escaped() -> None:
    table = TextTable(heads=["x"], rows=[["a|b *c*"]])
    assert table.as_markdown().endswith(r"| a\|b \*c\* |")
    assert table.as_markdown(escape=False).endswith("| a|b *c* |")


def test_html_escapes_texts_and_marks_continued_rows() -> None:
    html = TextTable(heads=["<b>"], rows=[["<i> & {0}"], [""]]).as_html("plain")
    assert '<table class="plain">' in html
    assert '<th scope="col">&lt;b&gt;</th>' in html
    assert "<tr><td>&lt;i&gt; &amp; {0}</td></tr>" in html
    assert '<tr class="group"><td></td></tr>' in html


def test_html_keeps_cells_that_are_marked_as_markup() -> None:
    link = Markup('<a href="#e=1">{}</a>').format("<1>")
    html = TextTable(heads=["id", "said"], rows=[[link, "<b>"]]).as_html()
    assert '<tr><td><a href="#e=1">&lt;1&gt;</a></td><td>&lt;b&gt;</td></tr>' in html


def test_html_has_row_headings_and_number_columns() -> None:
    html = TextTable(
        heads=("", ""), rows=[("runs", "7")], right_aligned=(1,), has_row_headings=True
    ).as_html()
    assert '<tr><th scope="row">runs</th><td class="number">7</td></tr>' in html
    assert "<thead>" not in html
