"""Open ten of the changes in `controller_changes.py` as pull requests, and look at what the action shows.

`python benchmarks/pull_requests.py [--only NAME] [--keep FOLDER]`, in Python 3.12 or later. A repository has
the shipped target with its library and the settings of a project. The steps of action.yml that have a script
run for each change with the environment that a runner gives them; from the second on, the store and the run
of the base come from the caches of the one before. What the gate says must fit the records of both runs;
annotations, summary, SARIF and the files of the artifact must be there.
"""

import argparse
import json
import re
import shutil
import sys
import tempfile
from pathlib import Path

from jsonschema.validators import validator_for  # type: ignore[import-untyped]

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from controller_changes import CHANGES, Change, apply_change  # noqa: E402

import mutator  # noqa: E402
from mutator.model import Record  # noqa: E402
from tests.github_runner import Runner, build_runner, git  # noqa: E402

CHANGES_OF_PULL_REQUESTS = (
    "renamed variable",
    "extracted function",
    "brake limit",
    "disengaging",
    "no model error",
    "brake scale",
    "speed gains",
    "lead filter",
    "brake rise",
    "lane width of leads",
)
NAME = "pulls"
CAMPAIGN = """\
schema: campaign/1
name: pulls
about: Faults without pictures behind a lead.
target: openpilot
scenarios: [S1]
faults:
  - {spec: radar/chaff/*, values: 3}
  - {spec: radar/jamming/*}
  - {spec: car_sensors/speed/slower, values: 4}
  - {spec: vision_output/path_model/both, values: 3}
  - {spec: vision_output/camera_unavailable/*}
reading: as_described
methods: [guided]
triggers: {table: accelerate_decelerate, rows: [C2], armed_after_s: 1.5}
seed: 1
canary: {spec: vision_output/path_model/both, scenario: S1, hazard: H3, at_s: 5.0}
"""
CACHES = ("mutator-store", f"mutator-runs/{NAME}/base")  # what a runner restores into its folder
SETTINGS = '[tool.mutator]\nlibrary = "fault_library"\ncampaigns = ["fault_library/campaigns/pulls.yaml"]\n'
MOST_ANNOTATIONS = 10
FILES_OF_ARTIFACT = (
    "comparison/index.html",
    "new/report/index.html",
    "new/exports/new-report.html",
    "junit.xml",
    "hazards.sarif",
)


def make_repository(place: Path) -> Path:
    """Make the repository and a clone of it, as a runner checks it out; return the clone."""
    origin, ignored = place / "origin", shutil.ignore_patterns("__pycache__", "compiled")
    for name in ("target", "fault_library", "templates"):
        shutil.copytree(ROOT / name, origin / name, ignore=ignored)
    (origin / "fault_library" / "campaigns" / f"{NAME}.yaml").write_text(CAMPAIGN)
    (origin / "pyproject.toml").write_text(SETTINGS)
    git(origin, "init", "--quiet")
    git(origin, "add", ".")
    git(origin, "commit", "--quiet", "-m", "the shipped controller")
    git(place, "clone", "--quiet", "--depth=1", origin.as_uri(), "work")
    return place / "work"


def new_hazards(runs: Path) -> set[str]:
    """Return the experiments with a hazard in the new run that they did not have on the base."""
    before, after = (dict(mutator.load_run(runs / name).folder.records()) for name in ("base", "new"))
    return {name for name, record in after.items() if hazard_names(record) - hazard_names(before[name])}


def hazard_names(record: Record) -> set[str]:
    return {name for name, _ in record.hazards}


def mistakes_in_view(runner: Runner, code: int, sarif_schema: Path | None) -> list[str]:
    """Return what is wrong in what a reader of the pull request sees."""
    runs = runner.temp / "mutator-runs" / NAME
    missing = [name for name in FILES_OF_ARTIFACT if not (runs / name).is_file()]
    if missing:
        return [f"no {name}" for name in missing]
    expected = new_hazards(runs)
    summary = (runner.temp / "summary.md").read_text()
    annotations = runner.annotations("error")
    sarif = json.loads((runs / "hazards.sarif").read_text())
    named = {result["properties"]["experiment"] for result in sarif["runs"][0]["results"]}
    is_well = {
        "the gate passes new hazards": not expected or code == 1,
        "the gate fails without annotations": code == 0 or annotations,
        "annotations, and the gate passes": code == 1 or not annotations,
        "too many annotations": len(annotations) <= MOST_ANNOTATIONS + 1,
        "an annotation at no line of the target": all(" file=target/" in line for line in annotations),
        "the summary has another verdict": f"**The gate {'fails' if code else 'passes'}" in summary,
        "SARIF has other experiments": named == expected,
    }
    if sarif_schema:
        schema = json.loads(sarif_schema.read_text())
        is_well["SARIF is not valid"] = validator_for(schema)(schema).is_valid(sarif)
    return [text for text, holds in is_well.items() if not holds]


def run_pull_request(change: Change, repository: Path, place: Path) -> tuple[Runner, int]:
    """Push the change to a branch of its own; return its runner and the exit code of the job."""
    git(repository, "checkout", "--quiet", "-B", change.name.replace(" ", "-"), "origin/main")
    apply_change(change, repository / "target")
    git(repository, "commit", "--quiet", "--all", "-m", change.name)
    runner = build_runner(repository, place / "runner")
    move_caches(place / "caches", runner.temp)
    if (runner.temp / CACHES[1]).is_dir():
        runner.context["steps.base-run.outputs.cache-hit"] = "true"
    code = runner.run({"campaign": NAME, "base": "main"})
    git(repository, "worktree", "remove", "--force", str(runner.temp / "mutator-base"))
    return runner, code


def move_caches(source: Path, destination: Path) -> None:
    for name in CACHES:
        if (source / name).is_dir():
            (destination / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.move(source / name, destination / name)


def keep_view(runner: Runner, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "log.txt").write_text(runner.log)
    shutil.copy(runner.temp / "summary.md", folder)
    sarif = runner.temp / "mutator-runs" / NAME / "hazards.sarif"
    if sarif.is_file():
        shutil.copy(sarif, folder)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--only", metavar="NAME", help="only changes of this name")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="keep summaries, logs and SARIF there")
    parser.add_argument("--sarif-schema", type=Path, metavar="FILE", help="check SARIF against this schema")
    options = parser.parse_args()
    by_name = {change.name: change for change in CHANGES}
    names = [name for name in CHANGES_OF_PULL_REQUESTS if options.only in (None, name)]
    is_wrong = False
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        repository = make_repository(place)
        for name in names:
            runner, code = run_pull_request(by_name[name], repository, place)
            mistakes = mistakes_in_view(runner, code, options.sarif_schema)
            is_wrong = is_wrong or bool(mistakes)
            left_out = re.search(r"since base: (\d+ of \d+) left out", runner.log)
            count = len(runner.annotations("error"))
            print(
                f"{name:20} gate {'fails' if code else 'passes':6} {count:3} annotations"
                f"  {left_out[1] if left_out else '-':>8} left out  {'; '.join(mistakes) or 'all well'}",
                flush=True,
            )
            if options.keep:
                keep_view(runner, options.keep / name.replace(" ", "-"))
            move_caches(runner.temp, place / "caches")
            shutil.rmtree(place / "runner")
    return int(is_wrong)


if __name__ == "__main__":
    sys.exit(main())
