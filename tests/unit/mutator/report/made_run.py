"""Made-up run folders for the tests of reports, and a parser of their pages."""

import json
from html.parser import HTMLParser
from pathlib import Path

from mutator._common.hashing import as_json_types
from mutator.results.severity_and_sentence_columns import TIME_TO_HAZARD_COLUMNS
from mutator.results.table_columns import result_columns
from mutator.store import file_digests, plan_file
from mutator.store.checksummed_lines import LineWriter
from mutator.store.file_digests import DigestLedger
from mutator.store.plan_choices import Choices
from mutator.store.session_environments import SessionEnvironment
from mutator.store.timings import TIMINGS_SCHEMA
from tests.made_head import made_head
from tests.made_up_results import write_results

COMPARED = ("gas", "brake", "steer_torque")
COLUMNS = result_columns(("H1", "H2", "H3"), COMPARED, (), TIME_TO_HAZARD_COLUMNS)
HEAD = made_head(
    campaign="night_<b>drive</b>",
    compared=COMPARED,
    choices=as_json_types(Choices(limit=4)),  # more than were planned, so it is no sample
    stretches=[
        as_json_types(SessionEnvironment(python="3.11.7", platform="Linux", packages={"numpy": "2.4.6"}))
    ],
)
OK = {
    "module": "radar",
    "fault_type": "chaff",
    "variant": "distance",
    "value": "35",
    "unit": "m",
    "scenario": "S1",
    "method": "guided",
    "trigger": "C2",
    "seed": "7",
    "status": "ok",
    "outcome": "hazard",
    "t_activation": "7.0",
    "t_manifest": "7.1",
    "h1": "1",
    "t_h1": "18.25",
    "h2": "0",
    "h3": "0",
}
NONE = {"outcome": "", "h1": "", "t_h1": "", "h2": "", "h3": ""}
PATCH = """\
diff --git a/pkg/_fi.py b/pkg/_fi.py
new file mode 100644
--- /dev/null
+++ b/pkg/_fi.py
@@ -0,0 +1,1 @@
+HOLD = "while"
diff --git a/pkg/radar.py b/pkg/radar.py
--- a/pkg/radar.py
+++ b/pkg/radar.py
@@ -1,2 +1,3 @@
 d_rel = see()
+d_rel = d_rel + 35.0  # fi:0a1b2c3d
 v_rel = 0
"""
BAD = OK | NONE | {"status": "harness_error", "detail": "the disk | is <gone>"}
CRASHED = OK | NONE | {"status": "crashed", "detail": "IndexError"}
LINES = [
    {"experiment_id": f"{i}" * 16, "fault_id": f"f{i}"} | line for i, line in enumerate((OK, BAD, CRASHED))
]


def make_run(folder: Path, **head: object) -> Path:
    """Write a run folder whose results are only a table: a hazard, a crash and a harness error. `head` is
    added to run.json."""
    (folder / "run.json").write_text(json.dumps(HEAD | head))
    write_results(folder, COLUMNS, LINES)
    plan_file.write_plan(folder, [], [])
    file_digests.save_ledger(folder, DigestLedger(files={}))
    (folder / "plots").mkdir()
    (folder / "plots" / ("0" * 16 + "-14.50s.jpg")).write_bytes(b"picture")
    return folder


COST = {"cpu_s": 1.0, "wall_s": 1.0, "host": "h", "worker": "a", "engine": "reference", "why": ""}


def make_two_runs(folder: Path) -> None:
    """Write the runs `before` and `after` of one plan: the hazard of one experiment is gone, and another has
    one.
    """
    calm = OK | NONE | {"outcome": "masked"}
    for hour, (name, lines) in enumerate((("before", (OK, calm, calm)), ("after", (calm, OK, calm))), 1):
        (folder / name).mkdir()
        run = make_run(folder / name)
        named = [{"experiment_id": f"{i}" * 16, "fault_id": "f"} | line for i, line in enumerate(lines)]
        write_results(run, COLUMNS, named)
        timings = LineWriter(
            run / "timings" / "0001-a.jsonl", {"schema": TIMINGS_SCHEMA, "plan": HEAD["plan"]}
        )
        for line in named[::-1]:  # the last line is not the last experiment that ended
            ended = f"2026-11-24T{hour:02}:0{line['experiment_id'][0]}:00Z"
            timings.append(COST | {"experiment_id": line["experiment_id"], "ended": ended})
        timings.close()


class Page(HTMLParser):
    """Parse the text and the links of a page. Fail if tags are not closed in order."""

    VOID = ("meta", "link", "br", "img", "input", "wbr")

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.texts: list[str] = []
        self.links: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.open.append(tag)
        self.links += [value or "" for name, value in attrs if name in ("href", "src")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.texts.append(data.strip())
