"""The published observations in a run's report: found in the library, put to the results, written."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from mutator._common.files import write_atomic
from mutator._common.tables import Table
from mutator.paper import observations, observations_page
from mutator.paper.observations import Summed
from mutator.paper.published import has_paper, load_paper
from mutator.statistics import sheets
from mutator.store.run_folder import RunFolder
from mutator.workspace import Workspace

FILE = "observations.md"


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """The observations of a report. `ends`: when a run of each scenario ends, s of simulation."""

    observations: tuple[Summed, ...]
    coverage: str
    ends: tuple[tuple[str, float], ...]

    @property
    def verdicts(self) -> str:
        return observations_page.verdicts(self.observations)

    def table(self, observation: Summed) -> Table:
        return observations_page.table(observation)

    @property
    def rules(self) -> str:
        return observations_page.rules()

    @property
    def session(self) -> str:
        return observations_page.session(self.ends)


def told(folder: RunFolder, workspace: Workspace, frame: pd.DataFrame, done: int) -> Told | None:
    """The observations that the library cites, put to the results; None when it cites none, or when the run
    has none of the published fault types. `done`: experiments of the plan that were run."""
    references = workspace.library / "references"
    file = references / observations.FILE
    if not (file.is_file() and has_paper(references)):
        return None
    kinds = list(dict.fromkeys(kind for _, kind in load_paper(references).coverage))
    missing = sorted(set(kinds) - set(frame["kind"]))
    if len(missing) == len(kinds):
        return None
    ends: Mapping[str, float] = sheets.run_ends(folder, workspace) or {}
    runs, lacks = frame.assign(t_end=frame["scenario"].map(ends)), list(_lacks(folder, missing, done))
    return Told(
        observations=observations.judge(file, runs, lacks),
        coverage=_coverage(folder, frame, len(kinds), missing),
        ends=tuple(sorted(ends.items())),
    )


def _lacks(folder: RunFolder, missing: list[str], done: int) -> Iterator[str]:
    """Why the run is not the paper's mixture of faults. A shard is but a part of its plan, too."""
    if missing:
        yield f"{len(missing)} of the paper's fault types are missing"
    if done < (planned := int(folder.head["experiments"])):
        yield f"only {done} of the {planned} experiments of the plan have been run"


def write(made: Told, out: Path) -> None:
    """Write observations.md and tables/observations.csv."""
    text = observations_page.markdown(made.observations, made.ends, made.coverage)
    write_atomic(out / FILE, text.encode())
    table = observations_page.sheet(made.observations)
    folder = out / sheets.FOLDER
    folder.mkdir(exist_ok=True)
    write_atomic(folder / f"{table.name}.csv", table.csv().encode())


def _coverage(folder: RunFolder, frame: pd.DataFrame, kinds: int, missing: list[str]) -> str:
    text = f"From {len(frame)} of {folder.planned} experiments, which have {kinds - len(missing)} of the "
    text += f"paper's {kinds} fault types."
    return text + (f" Missing: {', '.join(missing)}." if missing else "")
