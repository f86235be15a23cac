"""Colours, tables and the progress bar of a terminal."""

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from mutator._common.message_text import wrap_text
from mutator.cli.progress_display import campaign_progress
from mutator.cli.terminal_output import Terminal
from mutator.execution.progress_text import describe_duration
from mutator.mutants.patches_by_file import patch_without_new_files
from mutator.store.run_progress import Progress

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json

DIGEST = "0123456789abcdef" * 4
ANSI = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
PATCH = """\
diff --git a/p/_fi.py b/p/_fi.py
new file mode 100644
--- /dev/null
+++ b/p/_fi.py
@@ -0,0 +1 @@
+probe
diff --git a/p/a.py b/p/a.py
--- a/p/a.py
+++ b/p/a.py
@@ -1 +1,2 @@
 a = 1
+a = 2
"""


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make Rich treat its output as a terminal of 120 columns."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.delenv("NO_COLOR", raising=False)


def test_inserted_lines_of_a_diff_are_green(cli: Cli, root: Path, terminal: None) -> None:
    answer = cli("diff", "sensor/silence")
    assert re.search(r"\x1b\[32m\+ +if not _fi.active", answer.out)
    assert "+        if not _fi.active" in ANSI.sub("", answer.out)


def test_a_table_fits_the_terminal(cli: Cli, root: Path, terminal: None) -> None:
    lines = ANSI.sub("", cli("list", "models").out).splitlines()
    assert all(len(line.rstrip()) <= 120 for line in lines)
    assert any(set(line.strip()) == {"─"} for line in lines)


def test_json_stays_plain_in_a_terminal(cli: Cli, root: Path, terminal: None) -> None:
    assert cli("list", "specs", "--json").json["specs"]


def notify_all(notify: Callable[[Progress], None]) -> None:
    notify(Progress(stage="checks", done=1, total=7))
    counts = Counter(hazard=2, sdc=1)
    run = Progress(stage="experiments", total=60, outcomes=counts)
    notify(replace(run, done=3, per_s=0.28, remaining_s=200.0))
    notify(replace(run, done=4, per_s=1.52, remaining_s=195.0))


def test_a_terminal_shows_a_progress_bar(capsys: pytest.CaptureFixture[str], terminal: None) -> None:
    with campaign_progress(Terminal()) as notify:
        notify_all(notify)
    err = ANSI.sub("", capsys.readouterr().err)
    for wanted in ("experiments", "4/60", "1.5 a second", "hazard 2, sdc 1", "3 min 15 s left"):
        assert wanted in err


def test_a_log_shows_lines_of_progress(capsys: pytest.CaptureFixture[str]) -> None:
    with campaign_progress(Terminal()) as notify:
        notify_all(notify)
    assert capsys.readouterr().err.splitlines() == [
        "checks 1/7",
        "experiments 3/60, 16.8 a minute, hazard 2, sdc 1, 3 min 20 s left",
    ]


def test_a_message_of_progress_in_a_log_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "40")
    with campaign_progress(Terminal()) as notify:
        notify(Progress(stage="experiments", done=3, total=60, per_s=0.28, remaining_s=615.0))
    assert capsys.readouterr().err == "experiments 3/60, 16.8 a minute, 10 min 15 s left\n"


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.4, "0 s"), (59.4, "59 s"), (59.6, "1 min 00 s"), (3599, "59 min 59 s"), (7500, "2 h 05 min")],
)
def test_durations_are_put_into_words(seconds: float, words: str) -> None:
    assert describe_duration(seconds) == words


def test_a_diff_for_readers_leaves_out_new_files() -> None:
    text, note = patch_without_new_files(PATCH)
    assert text == PATCH[PATCH.index("diff --git a/p/a.py") :]
    assert "p/_fi.py" in note
    assert patch_without_new_files(text) == (text, "")


def test_each_stage_has_its_own_remaining_time(capsys: pytest.CaptureFixture[str]) -> None:
    with campaign_progress(Terminal()) as notify:
        for stage in ("plan", "checks", "golden", "proof", "tables", "report"):
            timed = {"done": 7, "total": 23, "remaining_s": 8.0} if stage == "proof" else {}
            notify(Progress(stage=stage, **timed))
    lines = capsys.readouterr().err.splitlines()
    assert lines == ["planning", "checks", "golden runs", "proof 7/23, 8 s left", "tables", "report"]


LONG = "expected: one of " + ", ".join(f"'name_{line}' (line {line})" for line in range(34, 39))
COMMAND = "`mutator review approve 3b5103806ae0 a9281388d042 --campaign paper_smoke --by NAME`"


@pytest.mark.parametrize(
    ("text", "width", "lines"),
    [
        ("short  and\tleft  alone", 22, ["short  and\tleft  alone"]),
        ("one two three", 8, ["one two", "  three"]),
        ("  to do: mend it now", 14, ["  to do: mend", "    it now"]),
        ("plot  a value of many words", 20, ["plot  a value of", "      many words"]),
        ("a /path/that/is/longer/than/a/line b", 12, ["a", "  /path/that/is/longer/than/a/line", "  b"]),
        ("no-break at-hyphens", 10, ["no-break", "  at-hyphens"]),
        ("do it: `mutator run x` now", 14, ["do it:", "  `mutator run x`", "  now"]),
        ("one two\n| a cell | of a table |", 8, ["one two", "| a cell | of a table |"]),
        (f"results digest: {DIGEST}", 60, [f"results digest: {DIGEST}"]),
        (f"plan         {DIGEST}", 60, [f"plan         {DIGEST}"]),
        (f"it is the seal: {DIGEST}, it says", 60, ["it is the seal:", f"  {DIGEST},", "  it says"]),
        ("", 8, [""]),
    ],
)
def test_long_lines_are_folded(text: str, width: int, lines: list[str]) -> None:
    assert wrap_text(text, width).split("\n") == lines


@pytest.mark.parametrize(("columns", "width"), [(None, 100), ("60", 60), ("many", 100)])
def test_output_to_a_pipe_is_folded_at_100_columns_by_default(
    columns: str | None, width: int, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("COLUMNS")
    if columns:
        monkeypatch.setenv("COLUMNS", columns)
    terminal = Terminal()
    terminal.print_text(LONG)
    terminal.print_note(LONG)
    terminal.print_error(LONG)
    out, err = capsys.readouterr()
    for line in (out + err).splitlines():
        assert len(line) <= width
    assert max(map(len, out.splitlines())) > width - 20
    assert " ".join(out.split()) == LONG
    terminal.print_text(LONG, without_folding=True)
    terminal.print_table(["a", "b"], [(LONG, COMMAND)])
    whole = capsys.readouterr().out.splitlines()
    assert whole[0] == LONG
    assert whole[2].split("  ") == [LONG, COMMAND]


def test_a_command_to_copy_is_never_folded(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It stands behind its introduction, or on a line of its own."""
    command = "mutator show --only 'fault_type == \"...\"'"
    for columns, lines in (
        ("60", [f"list them: {command}"]),
        ("40", ["list them:", f"  {command}"]),
    ):
        monkeypatch.setenv("COLUMNS", columns)
        Terminal().print_command("list them:", command)
        assert capsys.readouterr().out.splitlines() == lines


def test_a_number_keeps_its_unit_in_a_pipe(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "30")
    Terminal().print_text("it touches the vehicle at 6.4 m/s, it says")
    assert capsys.readouterr().out.splitlines() == ["it touches the vehicle at", "  6.4 m/s, it says"]


def test_output_to_a_terminal_is_folded_at_its_width(
    capsys: pytest.CaptureFixture[str], terminal: None
) -> None:
    Terminal().print_text(f"{LONG}; or {COMMAND}")
    lines = ANSI.sub("", capsys.readouterr().out).splitlines()
    assert all(len(line) <= 120 for line in lines)
    assert " ".join(" ".join(lines).split()) == f"{LONG}; or {COMMAND}"
    assert lines[-1].endswith(COMMAND)


def test_json_is_never_folded(cli: Cli, root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    wide = cli("list", "specs", "--json").out
    monkeypatch.setenv("COLUMNS", "20")
    assert cli("list", "specs", "--json").out == wide


def test_no_text_controls_the_terminal(capsys: pytest.CaptureFixture[str]) -> None:
    terminal = Terminal()
    terminal.print_text("kernel \x1b[2J\x9b1m\r\tx")
    terminal.print_table(["a"], [["\x1b]0;x\x07"]])
    terminal.print_error("\x08")
    out, err = capsys.readouterr()
    assert "kernel \\x1b[2J\\x9b1m\\r" in out and "\\x1b]0;x\\x07" in out and "\\x08" in err
    assert not {"\x1b", "\x9b", "\r", "\x07", "\x08"} & {*out, *err}
