"""What a bench and its workers send to each other."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mutator.execution.written_files import FileDigests
from mutator.model import Experiment


@dataclass(frozen=True, slots=True, kw_only=True)
class AssignedExperiments:
    """Experiments for one worker, with what it may not know yet. `is_proof`: run them for the proof."""

    experiments: tuple[Experiment, ...]
    golden_digests: Mapping[str, str]
    scenario_files: Mapping[str, Path]
    is_proof: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class WorkEnding:
    """The end of assigned experiments. `problem`: why not all of them have a record; empty if they have.
    `written`: what a worker wrote that ends.
    """

    problem: str = ""
    written: FileDigests = field(default_factory=dict)
