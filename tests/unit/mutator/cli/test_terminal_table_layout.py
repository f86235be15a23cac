"""Tables in terminals of any width: nothing is broken inside a word."""

from hypothesis import given, settings
from hypothesis import strategies as st

from mutator._common.message_text import unbreakable_parts
from mutator.cli.terminal_table_layout import TableLayout, TerminalTable

WORDS = st.text("abcdefgh/_0123456789.", min_size=1, max_size=24)
CELLS = st.lists(WORDS, max_size=9).map(" ".join)
TABLES = st.integers(1, 7).flatmap(
    lambda size: st.builds(
        lambda heads, rows, priorities: TerminalTable(heads=heads, rows=rows, priorities=priorities),
        st.lists(WORDS, min_size=size, max_size=size),
        st.lists(st.lists(CELLS, min_size=size, max_size=size), min_size=1, max_size=5),
        st.permutations(range(size)),
    )
)
EXPERIMENTS = TerminalTable(
    heads=["experiment", "ending", "hazards", "fault", "drive"],
    rows=[
        ["523316c9", "hazard", "H1", "car_sensors/speed/slower 50 mph", "S3, random/C4"],
        ["015db20f", "sdc", "", "vision_output/camera_unavailable/no_data", "S5, C4"],
    ],
    right_aligned=(2,),
    priorities=(0, 1, 3),
)


def lines(table: TerminalTable, width: int | None) -> list[str]:
    return ["".join(text for text, _ in line) for line in table.as_lines(table.layout(width), {})]


def shown_columns(layout: TableLayout) -> list[int]:
    return sorted(column.index for columns in layout.lines for column in columns)


@settings(max_examples=60, deadline=None)
@given(TABLES, st.integers(20, 240))
def test_no_word_or_number_of_a_shown_column_is_broken(table: TerminalTable, width: int) -> None:
    """Each word of a shown cell stands whole in a line; the other columns are named as left out."""
    layout = table.layout(width)
    printed = [" ".join(line.split()) for line in lines(table, width)]
    assert sorted([*shown_columns(layout), *layout.dropped]) == list(range(len(table.heads)))
    for index in shown_columns(layout):
        for cell in (table.heads[index], *(row[index] for row in table.rows)):
            for part in unbreakable_parts(cell):
                assert any(part.replace("\u00a0", " ") in line for line in printed)


@settings(max_examples=60, deadline=None)
@given(TABLES, st.integers(40, 240))
def test_lines_fit_the_terminal(table: TerminalTable, width: int) -> None:
    """Unless a word is too long for it, which stays whole."""
    assert max(map(len, lines(table, width))) <= width


@settings(max_examples=60, deadline=None)
@given(TABLES)
def test_a_table_without_a_limit_shows_every_row_in_one_line(table: TerminalTable) -> None:
    layout = table.layout(None)
    assert (len(layout.lines), layout.dropped) == (1, ())
    assert len(lines(table, None)) == len(table.rows) + 2


def test_a_wide_terminal_leaves_out_the_least_important_columns() -> None:
    table = TerminalTable(
        heads=EXPERIMENTS.heads,
        rows=[[*row[:3], row[3] + "/" + "x" * 40, row[4]] for row in EXPERIMENTS.rows],
        priorities=EXPERIMENTS.priorities,
    )
    layout = table.layout(104)
    assert (len(layout.lines), [table.heads[i] for i in layout.dropped]) == (1, ["hazards", "drive"])


def test_a_narrow_terminal_shows_an_entry_in_two_lines() -> None:
    assert lines(EXPERIMENTS, 60) == [
        "experiment  ending  hazards",
        "  fault                                     drive",
        "─" * 57,
        "523316c9    hazard       H1",
        "  car_sensors/speed/slower 50 mph           S3, random/C4",
        "015db20f    sdc",
        "  vision_output/camera_unavailable/no_data  S5, C4",
    ]


def test_a_number_stays_with_its_unit_and_a_command_whole() -> None:
    table = TerminalTable(
        heads=["what", "to do"], rows=[["a gap of 12 m", "run `pip install x` at once, please"]]
    )
    assert lines(table, 48)[2:] == [
        "a gap of 12 m  run `pip install x` at once,",
        "               please",
    ]


def test_a_last_column_to_copy_is_never_folded() -> None:
    """The columns before it stay, and the rule is as wide as the terminal."""
    anchor = "{function: Sensor.sense, argument: measure, which: 1}"
    table = TerminalTable(heads=["line", "at"], rows=[["12", anchor]], last_is_whole=True)
    assert lines(table, 30) == ["line  at", "─" * 30, f"12    {anchor}"]


def test_the_last_row_of_totals_is_set_apart() -> None:
    table = TerminalTable(heads=["kind", "n"], rows=[["a", "1"], ["total", "1"]], last_is_total=True)
    assert lines(table, 80)[3].strip("─") == "" and lines(table, 80)[4].startswith("total")
