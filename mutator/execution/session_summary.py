"""What a session reports when it ends."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from mutator.audit.run_digests_and_seal import Seals
from mutator.errors import EXIT_CHECK_FAILED, EXIT_HARNESS_ERRORS, EXIT_OK
from mutator.model import Outcome, Status
from mutator.preflight import equivalence_check
from mutator.store.run_folder import RunFolder

EXIT_INTERRUPTED = 130  # 128 + SIGINT, as shells report it


@dataclass(frozen=True, kw_only=True)
class Summary:
    """The outcome of a session. `outcomes` is as in Progress."""

    planned: int  #: planned experiments in this folder
    done: int  #: experiments with a final record
    ran: int  #: experiments that ran in this session
    outcomes: Counter[str]  #: experiments by outcome or status
    harness_errors: tuple[tuple[str, str], ...]  #: (experiment id, detail) of each harness error
    problem: str  #: why the session ended early (disk full, a worker died); else empty
    interrupted: bool  #: whether a signal ended the session
    results: Path | None  #: path of results.csv; None if the disk was full
    proof: equivalence_check.EquivalenceResult | None  #: the equivalence check; None if none was needed
    seals: Seals  #: the digests to publish: the seal, the results digest and the review digest
    not_forked: (
        str  #: why no experiment was forked; empty if one was, or if the reference engine was requested
    )
    elapsed_s: float  #: duration of the session (s)
    #: whether, without a canary, no experiment of the whole plan has reached a hazard
    has_reached_nothing: bool = False
    #: which experiments were left out because their golden run has a hazard; empty if none was
    golden_hazards_note: str = ""
    reused: int = 0  #: experiments of this session whose result was copied from an earlier run
    left_out: int = 0  #: experiments that `since` left out: their earlier records stand
    since_note: str = ""  #: what `since` left out, and why others ran; empty without it
    is_provisional: bool = False  #: whether the session ended before all checks had passed
    unselected: int = 0  #: experiments without a record that `last_failed` did not select
    #: the summaries of the runs with defences, by the names of their sets
    defended: Mapping[str, "Summary"] = field(default_factory=dict)

    @property
    def reuse_note(self) -> str:
        """How many results were copied; empty if none was."""
        if not self.reused:
            return ""
        return f"{self.reused:,} of {self.ran:,} reused: earlier runs had the same experiments"

    @property
    def selection_note(self) -> str:
        """How many experiments `last_failed` left to run; empty if none."""
        if not self.unselected:
            return ""
        return f"not selected by --last-failed: {self.unselected:,}; without it, the same command runs them"

    @property
    def provisional_note(self) -> str:
        """That the verdicts so far are provisional; empty if they are not."""
        if not self.is_provisional:
            return ""
        return "not all checks have passed yet: the verdicts so far are provisional, and have no table"

    @property
    def seal(self) -> str | None:
        """The seal; None if the run is not finished."""
        return self.seals.seal

    @property
    def proof_note(self) -> str:
        """The state of the proof, or why there is none; empty if the reference engine was requested."""
        if self.not_forked:
            return f"none is needed, because no experiment was forked: {self.not_forked}"
        return str(self.proof) if self.proof else ""

    def describe_unfinished(self) -> str:
        """Return why not all experiments have a result."""
        if self.has_left_out_all:
            return self.golden_hazards_note
        parts = [f"experiments with a result: {self.done} of {self.planned}"]
        if self.harness_errors:
            name, detail = self.harness_errors[0]
            parts.append(f"harness errors: {len(self.harness_errors)} (first: {name}: {detail})")
        if self.problem:
            parts.append(self.problem)
        if self.interrupted:
            parts.append("interrupted")
        return "; ".join(parts) + "; the same call resumes the run"

    @property
    def has_left_out_all(self) -> bool:
        """Whether every experiment was left out, because its golden run has a hazard."""
        return 0 < self.outcomes[Status.LEFT_OUT] == self.planned

    @property
    def exit_code(self) -> int:
        """0: success; 1: every experiment was left out, or no hazard was reached, and no canary shows that
        one can be; 3: harness errors, or experiments left to run; 130: interrupted. The highest of this run
        and of those with defences.
        """
        return max([self._exit_code_of_run, *(summary.exit_code for summary in self.defended.values())])

    @property
    def _exit_code_of_run(self) -> int:
        if self.interrupted:
            return EXIT_INTERRUPTED
        is_proved = self.proof is None or self.proof.is_complete or bool(self.unselected)
        whole = self.done + self.unselected == self.planned and is_proved
        if not whole or self.problem:
            return EXIT_HARNESS_ERRORS
        return EXIT_CHECK_FAILED if self.has_reached_nothing or self.has_left_out_all else EXIT_OK


def has_reached_nothing(folder: RunFolder, outcomes: Mapping[str, int], unselected_count: int) -> bool:
    """Whether a whole plan without a canary shows no hazard. A part of it alone cannot tell, and no hazard
    with defences is a result.
    """
    is_whole = folder.shard is None and not unselected_count
    is_undefended = not folder.head.defences
    return folder.canary is None and not outcomes.get(Outcome.HAZARD) and is_whole and is_undefended
