"""The hazardous experiments of a run, worst first."""

from mutator.model import Experiment
from mutator.results.experiment_sentence import ExperimentSentences
from mutator.results.outcome_counting import first_hazard_times
from mutator.results.result_rows import ResultRow, rows_of
from mutator.results.table_reader import Results
from mutator.results.worst_first_ranking import worst_first_ranks
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder


def hazardous_experiments(folder: RunFolder) -> list[tuple[Experiment, ResultRow]]:
    """Return the experiments of a run folder with a hazard, and their results, worst first."""
    frame = Results.up_to_date(folder.path).frame()
    hazardous = frame[first_hazard_times(frame).notna().any(axis=1)]
    ranked = hazardous.iloc[worst_first_ranks(hazardous).argsort()]
    faults = plan_file.load_faults(folder.path)
    rows = rows_of(ranked, faults, ExperimentSentences.of_run(folder.head))
    ids = {row.experiment_id for row in rows}
    experiments = {e.id: e for e in plan_file.iterate_experiments(folder.path) if e.id in ids}
    return [(experiments[row.experiment_id], row) for row in rows]
