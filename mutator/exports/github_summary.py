"""The summary of a step on GitHub, in Markdown: the verdict, the worst experiments, and numbers."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from urllib.parse import quote

from mutator._common.message_text import SHORT_ID_LENGTH, counted
from mutator._common.table_rendering import TextTable, escaped_markdown_line
from mutator.campaigns.fault_positions import SourcePosition
from mutator.comparison.comparison_files import differing_files_text, verdict_word_and_sentence
from mutator.comparison.run_comparison_and_gates import Comparison, Gate
from mutator.errors import MutatorError
from mutator.execution.earlier_run import left_out_of_whole_run
from mutator.exports.highlights import ChartMaker, Highlight
from mutator.store.run_folder import RunFolder

_MOST_WORST = 3  # experiments with a sentence and a chart
_MOST_LISTED = 20  # further experiments in the table


@dataclass(frozen=True)
class Repository:
    """The address of the commit whose files a summary links to; '' without links."""

    commit_address: str = ""

    @classmethod
    def from_environment(cls, environment: Mapping[str, str]) -> "Repository":
        """Return the repository and commit that GitHub Actions names."""
        names = ("GITHUB_SERVER_URL", "GITHUB_REPOSITORY", "GITHUB_SHA")
        server, repository, commit = (environment.get(name, "") for name in names)
        is_whole = server and repository and commit
        return cls(f"{server}/{repository}/blob/{commit}" if is_whole else "")

    def link(self, position: SourcePosition) -> str:
        text = f"`{position}`"
        if not self.commit_address:
            return text
        lines = f"L{position.first_line}-L{position.last_line}"
        return f"[{text}]({self.commit_address}/{quote(position.path)}#{lines})"


def comparison_summary(
    comparison: Comparison,
    gates: Sequence[Gate],
    highlights: Sequence[Highlight],
    charts: ChartMaker,
    repository: Repository,
) -> str:
    """Return the summary of a comparison. `gates` are those of the command, `highlights` the experiments on
    which they fail, or without gates those with a change for the worse; worst first.
    """
    changes = next(sheet for sheet in comparison.sheets if sheet.name == "changes")
    parts = [
        f"## {escaped_markdown_line(f'{comparison.names.a} against {comparison.names.b}')}",
        _gate_verdict(comparison, gates, highlights),
        verdict_word_and_sentence(comparison)[1],
        differing_files_text(comparison),
        *map(escaped_markdown_line, comparison.remarks),
        *_left_out_by_since(comparison.b.folder),
        *_reason_without_places(charts),
        *_worst_experiments(highlights, charts, repository),
        f"### {changes.title}",
        changes.table().as_markdown(),
    ]
    return "\n\n".join(filter(None, parts)) + "\n\n"


def run_summary(
    name: str,
    verdict: str,
    counts: TextTable,
    highlights: Sequence[Highlight],
    charts: ChartMaker,
    repository: Repository,
) -> str:
    """Return the summary of a run; `highlights` are its hazardous experiments, worst first."""
    parts = [
        f"## {escaped_markdown_line(name)}",
        f"**{escaped_markdown_line(verdict)}**",
        *_left_out_by_since(charts.folder),
        *_reason_without_places(charts),
        *_worst_experiments(highlights, charts, repository),
        "### Results",
        counts.as_markdown(),
    ]
    return "\n\n".join(parts) + "\n\n"


def error_summary(error: MutatorError) -> str:
    """Return the summary of a command that ended with an error."""
    texts = (
        error.got,
        error.where and f"In {error.where}.",
        error.expected and f"Expected: {error.expected}.",
        error.remedy and f"To do: {error.remedy}.",
    )
    parts = ["## mutator could not finish", *map(escaped_markdown_line, filter(None, texts))]
    return "\n\n".join(parts) + "\n\n"


def _gate_verdict(comparison: Comparison, gates: Sequence[Gate], highlights: Sequence[Highlight]) -> str:
    if not gates:
        return ""
    names = ", ".join(f"`{gate.value}`" for gate in gates)
    if highlights:
        counts = Counter(gate for each in highlights for gate in each.title.split(", "))
        listed = ", ".join(f"`{name}` {count}" for name, count in counts.items())
        return f"**The gate fails for {counted(len(highlights), 'experiment')}: {listed}.**"
    if missing := comparison.missing_result_count:
        return f"**The gate cannot decide: {counted(missing, 'result')} missing.** It looks for {names}."
    return f"**The gate passes: no experiment fails {names}.**"


def _left_out_by_since(folder: RunFolder) -> list[str]:
    text = left_out_of_whole_run(folder)
    return [f"`--since`: {escaped_markdown_line(text)}."] if text else []


def _reason_without_places(charts: ChartMaker) -> list[str]:
    reason = charts.source.reason
    return [escaped_markdown_line(f"Places in the source are not shown: {reason}.")] if reason else []


def _worst_experiments(
    highlights: Sequence[Highlight], charts: ChartMaker, repository: Repository
) -> list[str]:
    worst, others = highlights[:_MOST_WORST], highlights[_MOST_WORST:]
    parts = ["### The worst"] if worst else []
    for each in worst:
        place = f"{repository.link(each.position)}: " if each.position else ""
        ending = each.description.removeprefix(f"{each.experiment.label}: ")
        parts += [
            f"#### {escaped_markdown_line(each.experiment.label)}",
            f"{place}{escaped_markdown_line(f'{each.title}: {ending}')} "
            f"(`{each.experiment.id[:SHORT_ID_LENGTH]}`)",
            escaped_markdown_line(each.sentence),
            charts.chart(each),
        ]
    if others:
        parts += ["### And", _experiments_table(others[:_MOST_LISTED], repository)]
    if more := len(others[_MOST_LISTED:]):
        parts.append(f"and {counted(more, 'more experiment')}.")
    return [part for part in parts if part]


def _experiments_table(highlights: Sequence[Highlight], repository: Repository) -> str:
    rows = [
        (
            repository.link(each.position) if each.position else "-",
            *(escaped_markdown_line(text).replace("|", "\\|") for text in (each.title, each.description)),
            f"`{each.experiment.id[:SHORT_ID_LENGTH]}`",
        )
        for each in highlights
    ]
    heads = ("place", "why", "experiment", "id")
    return TextTable(heads=heads, rows=rows).as_markdown(escape=False)
