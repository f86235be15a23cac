"""How injected lines are recognized in a mutant's source."""

import re

from mutator.mutants import injected_line_syntax
from mutator.web import asset_text
from mutator.workspace import Workspace


def test_injected_lines_are_recognized_by_their_tags(clone: Workspace) -> None:
    lines = {
        injected_line_syntax.probe_import_line("car"): ("probe", 0, False),
        injected_line_syntax.tagged_line(
            injected_line_syntax.observation_call_source([("t", "now.time")]),
            injected_line_syntax.OBSERVATION_TAG,
        ): (
            "observe",
            0,
            False,
        ),
        injected_line_syntax.tagged_line('if _fi.active("0a1b2c3d"):', "0a1b2c3d"): ("0a1b2c3d", 0, True),
        injected_line_syntax.tagged_line('if not _fi.active("0a1b2c3d"):', "0a1b2c3d", 12): (
            "0a1b2c3d",
            12,
            True,
        ),
        injected_line_syntax.tagged_line("    x = 1", "0a1b2c3d"): ("0a1b2c3d", 0, True),
    }
    for line, (name, guarded, of_fault) in lines.items():
        for end in ("", "\n", "\r\n"):
            tag = injected_line_syntax.tag_of((line + end).encode())
            assert tag is not None
            assert (tag.id, tag.guarded_line_count, tag.is_of_fault) == (name, guarded, of_fault)
            assert tag.is_guard == ("if " in line)
            assert tag.line_without_tag.decode() == line.partition("  #")[0]
        assert injected_line_syntax.find_tagged_line(f"x = 1\n{line}\n".encode()) == 1
        assert injected_line_syntax.adds_fault(f"+{line}") is of_fault
        assert list(injected_line_syntax.tagged_addition_spans(f"+{line}\n", 0, 999)) == [(1, len(line) + 1)]


def test_a_similar_comment_is_not_a_tag(clone: Workspace) -> None:
    """A tag is lowercase and ends its line."""
    for line in (
        b"x = 1",
        b"x = 1  # fi",
        b"x = 1  # fi:",
        b"x  # fi:ABC",
        b"x  # fi:abc, say",
        b"y  # fi:a guard:",
    ):
        assert injected_line_syntax.tag_of(line) is None
    assert injected_line_syntax.find_tagged_line(b"wi_fi = 1\nx_fi = 2  # fi:A\n") is None


def test_pages_use_the_tags_defined_in_python() -> None:
    words = injected_line_syntax.tags_for_page_scripts()
    for tag in words["probe"]:
        assert injected_line_syntax.tagged_line("x", tag) == f"x  {words['mark']}{tag}"
    assert words["probe"] == [injected_line_syntax.PROBE_IMPORT_TAG, injected_line_syntax.OBSERVATION_TAG]
    assert "fi:" not in asset_text("shared/diff.js")
    assert not re.search("|".join(rf"{tag}\W*\|" for tag in words["probe"]), asset_text("shared/diff.js"))


MUTATED = b"""\
from car import _fi  # fi:probe
def read(frame):
    _fi.observe(t=now)  # fi:observe
    angle = (0.0 if _fi.active("0a1b2c3d") else decode(frame))  # fi:0a1b2c3d was:    angle = decode(frame)
    if _fi.active("aaaaaaaa"):  # fi:aaaaaaaa
        angle = 1.0  # fi:aaaaaaaa
    if not _fi.active("bbbbbbbb"):  # fi:bbbbbbbb guard:1
        send(angle)
    return angle
"""


def test_each_line_of_a_mutant_has_a_line_in_the_targets_file() -> None:
    """An injected line has that of the statement at its anchor, which stands above or below it."""
    lines = range(1, 10)
    assert [injected_line_syntax.target_line_of(MUTATED, line) for line in lines] == [
        1,
        1,
        1,
        2,
        2,
        2,
        2,
        3,
        4,
    ]
    below = [injected_line_syntax.target_line_of(MUTATED, line, ("aaaaaaaa", "bbbbbbbb")) for line in lines]
    assert below == [1, 1, 1, 2, 3, 3, 3, 3, 4]


def test_lines_of_the_target_are_found_in_the_mutated_file() -> None:
    """Also below injected lines, and where one replaces the target's line."""
    guard = injected_line_syntax.tagged_line('if _fi.active("0a1b2c3d"):', "0a1b2c3d", 1).encode()
    replaced = b"x = 3" + injected_line_syntax.replacement_tag(["0a1b2c3d"], b"x = 2")
    mutated = b"\n".join([guard, b"    x = 1", b"y = 1", replaced, guard, b"    z = 1", b""])
    lines = [injected_line_syntax.mutated_line_of(mutated, line) for line in range(1, 5)]
    assert lines == [2, 3, 4, 6]
    assert [injected_line_syntax.target_line_of(mutated, line) for line in lines] == [1, 2, 3, 4]
