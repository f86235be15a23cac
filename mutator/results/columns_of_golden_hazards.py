"""The columns of results.csv that say how golden runs ended. Only a run has them in which one has a
hazard.
"""

from collections.abc import Collection

from mutator.model import GoldenClass
from mutator.results.finished_experiments_and_columns import FinishedExperiment, ResultColumn
from mutator.store.golden_runs import GoldenRun

GOLDEN_CLASS, AGAINST_GOLDEN = "golden_class", "against_golden"


def golden_class_columns(
    golden_keys: Collection[str], *, several_seeds: bool
) -> tuple[ResultColumn, ResultColumn]:
    """Return the columns of a run. `golden_keys` are those of its golden runs that have a hazard."""

    def golden_class(finished: FinishedExperiment) -> str:
        golden_run = GoldenRun.for_experiment(finished.experiment, several_seeds=several_seeds)
        has_hazard = golden_run.key in golden_keys
        return (GoldenClass.HAZARD_WITHOUT_FAULT if has_hazard else GoldenClass.HAZARD_FREE).value

    return (
        ResultColumn(
            GOLDEN_CLASS,
            "text",
            "",
            "the class of the golden run, `hazard_free` or `hazard_without_fault`; only in runs with the "
            "latter",
            golden_class,
        ),
        ResultColumn(
            AGAINST_GOLDEN,
            "text",
            "",
            "how the hazards [compare](../explanation/verdicts.md#golden-runs-with-a-hazard) with those of a "
            "golden run that has some; only in such runs",
            lambda f: f.record.against_golden.value if f.record.against_golden else None,
        ),
    )
