"""The page finds the tags of injected lines in any text."""

import json
from typing import Any

import pytest

from mutator.mutants.injected_line_syntax import tags_for_page_scripts
from mutator.web import asset_text

CHANGED = 'x = (1 if _fi.active("a0") else "a\u2028b")  '
TAG = '# fi:a0 was:    x = "a\u2028b" # c'


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_a_tag_extends_to_the_end_of_its_line(browser: Any, end: str) -> None:
    lines = ["+from car import _fi  # fi:probe", '-x = "a\u2028b" # c', f"+{CHANGED}{TAG}", "+y = 1  # fi:a0"]
    patch = "diff --git a/m.py b/m.py\n--- a/m.py\n+++ b/m.py\n@@ -1,1 +1,3 @@\n" + end.join([*lines, ""])
    page = browser.new_page()
    page.set_content(
        f'<script type="application/json" id="tags">{json.dumps(tags_for_page_scripts())}</script><p></p>'
    )
    page.add_script_tag(
        content=f"{asset_text('shared/dom.js')}\n{asset_text('shared/diff.js')}\nglobalThis.Diff = Diff;"
    )
    (file,) = page.evaluate("(patch) => Diff.injected(patch)", patch)
    assert file["lines"] == [CHANGED.rstrip(), "y = 1"]
    page.evaluate("(patch) => Diff.render(document.querySelector('p'), patch)", patch)
    assert page.locator(".py-tag").all_text_contents() == ["# fi:probe", TAG, "# fi:a0"]
    page.close()
