"""The list of experiments, which renders only the rows in its window."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .conftest import Page

COPIES = 60  # of each row, so that the list is much longer than its window
LONG = """(copies) => {
    const read = Packed.read;
    Packed.read = async (name) => {
        const data = await read(name);
        if (name !== "table") return data;
        const grown = (values) => Array.from({ length: copies }, () => values).flat();
        for (const column of data.columns) {
            for (const key of ["numbers", "codes", "texts"]) column[key] &&= grown(column[key]);
        }
        data.count *= copies;
        return data;
    };
    document.getElementById("facets").replaceChildren();
    for (const old of document.querySelectorAll(".find .facet, .find .copy")) old.remove();
    return Report.start();
}"""
WINDOW = "document.getElementById('grid')"


def height(page: "Page") -> float:
    return float(page.page.evaluate(f"{WINDOW}.clientHeight"))


def test_the_window_shrinks_if_few_rows_match(page: "Page") -> None:
    before = height(page)
    page.page.fill("#search", "crashed")
    page.page.wait_for_function("document.querySelectorAll('#grid tr[data-at]').length < 3")
    assert height(page) < before / 3
    assert page.page.evaluate(f"{WINDOW}.scrollHeight <= {WINDOW}.clientHeight")
    page.page.fill("#search", "")
    page.wait_for_rows(24)
    assert height(page) == before


def test_a_filter_scrolls_to_the_worst_rows(page: "Page") -> None:
    page.page.evaluate(LONG, COPIES)
    page.page.evaluate(f"{WINDOW}.scrollTop = 1e6")
    page.page.wait_for_function("!document.querySelector('#grid tr[data-at=\"0\"]')")
    page.page.click('.tiles a:has-text("hazard")')
    page.page.wait_for_selector('#grid tr[data-at="0"]')
    assert page.page.evaluate(f"{WINDOW}.scrollTop") == 0


def test_an_experiment_opened_by_an_id_prefix_is_marked_in_the_list(page: "Page") -> None:
    name = page.page.inner_text("#grid tr[data-at='0'] code")
    page.open(f"e={name[:6]}")
    page.page.wait_for_selector("#experiment h2")
    assert page.texts("#grid tr.open code") == [name]


def test_other_columns_or_measures_do_not_scroll_the_list(page: "Page") -> None:
    page.page.evaluate(LONG, COPIES)
    page.page.evaluate(f"{WINDOW}.scrollTop = 9000")
    page.page.select_option("#measure", "activated")
    page.page.wait_for_function("location.hash.includes('heat=activated')")
    assert page.page.evaluate(f"{WINDOW}.scrollTop") == 9000


def test_a_severity_class_is_short_and_its_code_in_the_tooltip(page: "Page") -> None:
    """Words and code together leave no room for values and times."""
    label = "const label = Grid.severity('possibly fatal (severity S3)')"
    shown = page.page.evaluate(f"(() => {{ {label}; return [label.textContent, label.title]; }})()")
    assert shown == ["possibly fatal", "possibly fatal (severity S3)"]
