"""The reason why a run folder has no series of an experiment."""

from mutator.store.run_folder import RunFolder


def reason_for_missing_series(folder: RunFolder, *, is_packed: bool) -> str:
    """Return why an experiment that finished normally has no series in this run folder."""
    budget_mb = folder.series_budget_mb
    if not budget_mb:
        return "This run kept no channels, because it was made with --series-mb 0."
    if is_packed:
        return f"The channels of other experiments fill the run's {budget_mb:,} MB for them (--series-mb)."
    if not folder.is_finished:
        return (
            "The run was not finished when this page was written, and channels can be read when it is. "
            "Finish the run, then rebuild its report."
        )
    return "This run folder has no channels: its folder `series` was removed, or an older mutator wrote it."
