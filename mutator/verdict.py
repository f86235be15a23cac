"""From what a run recorded to its verdict: pure functions."""

from collections.abc import Sequence

from mutator.model import Activation, Outcome


def judge(
    *, activation: Activation | None, t_manifest: float | None, hazards: Sequence[tuple[str, float]]
) -> Outcome:
    """The outcome of an experiment that ran: not_activated, hazard, sdc or masked, the first that applies."""
    raise NotImplementedError


def reaction_time(t_hazard: float | None, t_alert: float | None) -> float | None:
    """First hazard minus first alert in s; None unless the alert came strictly before the hazard."""
    raise NotImplementedError
