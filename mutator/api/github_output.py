"""What comparisons and runs show in a step of GitHub Actions."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from mutator._common.message_text import counted
from mutator.api.comparisons import RunComparison
from mutator.api.runs import Run
from mutator.comparison.gate_failures import RECOMMENDED_GATES, failing_experiments, worst_first
from mutator.comparison.run_comparison_and_gates import Gate
from mutator.errors import EXIT_HARNESS_ERRORS, MutatorError
from mutator.execution.session_summary import Summary
from mutator.exports.github_annotations import annotation_commands, error_command
from mutator.exports.github_summary import (
    Repository,
    comparison_summary,
    error_summary,
    run_summary,
)
from mutator.exports.highlights import (
    ChartMaker,
    HighlightedSource,
    highlights_of_failures,
    highlights_of_hazards,
)
from mutator.results.hazards_worst_first import hazardous_experiments
from mutator.workspace import Workspace


@dataclass(frozen=True, slots=True)
class GitHubOutput:
    """Workflow commands to print, and Markdown for the summary of the step."""

    commands: tuple[str, ...]
    summary: str


def comparison_on_github(
    run_comparison: RunComparison,
    gates: Sequence[Gate],
    workspace: Workspace | None,
    environment: Mapping[str, str],
) -> GitHubOutput:
    """Return the experiments on which the gates fail; without gates, changes for the worse as warnings.

    `workspace` has the target of the second run; None: no places are shown. `environment` has the variables
    of GitHub Actions.
    """
    comparison = run_comparison.comparison
    failing = failing_experiments(comparison, run_comparison.findings(gates or RECOMMENDED_GATES))
    source = HighlightedSource.of_run(comparison.b.folder, workspace)
    highlights = highlights_of_failures(source, worst_first(comparison, failing))
    charts = ChartMaker(folder=comparison.b.folder, source=source, comparison=comparison)
    repository = Repository.from_environment(environment)
    return GitHubOutput(
        tuple(annotation_commands(highlights, "error" if gates else "warning")),
        comparison_summary(comparison, gates, highlights, charts, repository),
    )


def run_on_github(
    run: Run, summary: Summary, workspace: Workspace, environment: Mapping[str, str]
) -> GitHubOutput:
    """Return the hazards of a run as warnings, because a hazard is data, not a failure."""
    source = HighlightedSource.of_run(run.folder, workspace)
    highlights = highlights_of_hazards(source, hazardous_experiments(run.folder))
    verdict = f"{len(highlights):,} of {counted(summary.done, 'experiment')} led to a hazard."
    if summary.exit_code == EXIT_HARNESS_ERRORS:
        verdict = f"Not finished: {summary.done:,} of {summary.planned:,} experiments done. {verdict}"
    charts = ChartMaker(folder=run.folder, source=source)
    repository = Repository.from_environment(environment)
    return GitHubOutput(
        tuple(annotation_commands(highlights, "warning")),
        run_summary(run.folder.head.campaign, verdict, run.counts(), highlights, charts, repository),
    )


def error_on_github(error: MutatorError) -> GitHubOutput:
    """Return an error that ended a command, at its line if it names one."""
    return GitHubOutput((error_command(error),), error_summary(error))
