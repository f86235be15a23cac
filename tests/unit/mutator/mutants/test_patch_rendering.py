"""Patches apply with `patch -p1` and can be undone with `-R`."""

import shutil
import subprocess
from pathlib import Path

import pytest

from mutator.model import Anchor, AnchorKind, FaultLocation
from mutator.mutants import patch_rendering, splicing
from mutator.mutants.parsed_files_and_anchors import parse_file

LONG = "".join(f"y{i} = {i}\n" for i in range(20))
BODY = "".join(f"    y{i} = {i}\n" for i in range(10))


def make(data: bytes, names: list[str], guard: bool) -> tuple[str, bytes]:
    file = parse_file("pack/m.py", data, Path("root"))
    edits = [splicing.probe_import_edit(file, "pack")]
    for name in names:
        kind = AnchorKind.BEFORE_ASSIGN if guard else AnchorKind.AFTER_ASSIGN
        site = file.resolve_statement(
            FaultLocation(path="pack/m.py", function="f", anchor=Anchor(kind=kind, name=name))
        )
        maker = splicing.guard_edit if guard else splicing.insertion_edit
        edits.append(maker(file, site, ["if 1:"] if guard else ["x = 1"], "ab"))
    pieces = splicing.apply_edits(file, edits)
    return patch_rendering.render_changed_file("pack/m.py", pieces), splicing.mutated_bytes(pieces)


@pytest.mark.parametrize("guard", [False, True])
@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("def f():\n    x = 1\n", ["x"]),
        ("def f():\n    x = 1", ["x"]),
        ("def f():\r\n    x = 1\r\n    return x\r\n", ["x"]),
        ("def f():\r\n    x = 1", ["x"]),
        (f"{LONG}def f():\n    x = 1\n{BODY}    z = 3\n{LONG}", ["x", "z"]),
        (f"{LONG}def f():\n    x = 1\n    y = 2\n    z = 3\n{LONG}", ["x", "z"]),
        ("# coding: latin-1\ndef f():\n    x = '\xe9'\n", ["x"]),
    ],
)
def test_gnu_patch_applies_and_reverses_a_patch(
    tmp_path: Path, text: str, names: list[str], guard: bool
) -> None:
    if shutil.which("patch") is None:
        pytest.skip("the command patch is not installed")
    data = text.encode("latin-1" if "latin" in text else "utf-8")
    text_patch, mutated = make(data, names, guard)
    source = tmp_path / "pack" / "m.py"
    source.parent.mkdir()
    source.write_bytes(data)
    raw = text_patch.encode("utf-8", "surrogateescape")
    command = ["patch", "-p1", "--no-backup-if-mismatch", "--fuzz=0", "-s"]
    subprocess.run(command, cwd=tmp_path, input=raw, check=True)
    assert source.read_bytes() == mutated
    subprocess.run([*command, "-R"], cwd=tmp_path, input=raw, check=True)
    assert source.read_bytes() == data


def test_close_changes_share_a_hunk() -> None:
    """A hunk shows three lines before and after each change."""
    far, _ = make(f"{LONG}def f():\n    x = 1\n{BODY}    z = 3\n{LONG}".encode(), ["x", "z"], False)
    near, _ = make(f"{LONG}def f():\n    x = 1\n    y = 2\n    z = 3\n{LONG}".encode(), ["x", "z"], False)
    assert far.count("@@ -") == 3
    assert near.count("@@ -") == 2


def test_a_tab_follows_a_file_name_with_a_space() -> None:
    """`patch` requires the tab."""
    assert "+++ b/a file.py\t\n" in patch_rendering.render_new_file("a file.py", "x = 1\n")


@pytest.mark.parametrize(("end", "told"), [("\n", ""), ("", "\\ No newline at end of file\n")])
def test_every_line_of_a_new_file_is_added(end: str, told: str) -> None:
    head = "diff --git a/m.py b/m.py\nnew file mode 100644\n--- /dev/null\n+++ b/m.py\n@@ -0,0 +1,3 @@\n"
    assert (
        patch_rendering.render_new_file("m.py", f"a = 1\n\nb = 2{end}") == f"{head}+a = 1\n+\n+b = 2\n{told}"
    )
