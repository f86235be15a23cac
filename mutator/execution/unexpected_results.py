"""What a test says that fails because of a result."""

import shlex
from collections.abc import Sequence

from mutator.model import Experiment, Record
from mutator.mutants.patches_by_file import patch_without_new_files
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.finished_experiments_and_columns import FinishedExperiment
from mutator.results.table_columns import result_columns_of, row_of
from mutator.store.run_folder import RunFolder

_SHOWN_ID_LENGTH = 8


def describe_unexpected_result(
    folder: RunFolder,
    experiment: Experiment,
    record: Record,
    patch: bytes,
    problem: str,
    replay_options: Sequence[str] = (),
) -> str:
    """Return the experiment's sentence, what is not allowed, the injected change, and how to replay it: with
    these further options.
    """
    finished = FinishedExperiment(experiment, record, folder.severity_scale)
    row = row_of(result_columns_of(folder), finished)
    sentence = ExperimentSentences.of_run(folder.head).sentence(row, experiment.fault)
    change = patch_without_new_files(patch.decode(errors="replace"))[0].rstrip()  # without the probe
    replay = f"replay: {replay_command(folder, experiment.id, replay_options)}"
    return "\n".join([sentence, problem, "", change, "", replay])


def replay_command(folder: RunFolder, experiment_id: str, options: Sequence[str]) -> str:
    """Return the command that shows the drive of an experiment."""
    words = ["mutator", "show", experiment_id[:_SHOWN_ID_LENGTH], "--run", str(folder.path), "--drive"]
    return shlex.join([*words, *options])
