"""Print what a campaign explores, before it runs."""

from typing import TYPE_CHECKING

from mutator._common.message_text import counted
from mutator.cli.terminal_output import Terminal

if TYPE_CHECKING:
    from mutator.api.exploring_campaigns import ExploringCampaign
    from mutator.campaigns.exploration_section import ExploredPlane
    from mutator.store.plan_choices import Choices
    from mutator.workspace import Workspace


def plan_exploration(workspace: "Workspace", campaign: str, choices: "Choices") -> "ExploringCampaign":
    """Return what a campaign explores; MutatorError for choices that do not apply."""
    from mutator.api.exploring_campaigns import planned_exploration

    return planned_exploration(workspace, campaign, choices)


def print_exploration(terminal: Terminal, exploring: "ExploringCampaign", *, as_json: bool) -> None:
    """Print a row for each plane, and the most runs."""
    section = exploring.section
    facts = {
        "goal": section.goal,
        "most_runs": exploring.most_runs,
        "planes": [
            {"spec": plane.spec, "scenario": plane.scenario, "start": plane.start, "cells": _cells(plane)}
            for plane in section.planes
        ],
    }
    if as_json:
        terminal.print_json(facts)
    rows = [
        (p.spec, p.scenario, p.start, _magnitudes_text(p), _durations_text(p), _cells(p))
        for p in section.planes
    ]
    heads = ("fault", "scenario", "from", "magnitudes", "durations", "cells")
    terminal.print_table(heads, rows, right_aligned=(5,))
    planes, runs = counted(len(section.planes), "plane"), counted(exploring.most_runs, "run")
    more = "" if section.goal == "find" else " of search and validation; repairs and challengers come on top"
    terminal.print_text(
        f"{planes}, at most {runs}{more}. Results decide what is driven, so nothing is frozen."
    )


def _cells(plane: "ExploredPlane") -> int:
    return max(1, len(plane.magnitudes)) * len(plane.durations_s)


def _magnitudes_text(plane: "ExploredPlane") -> str:
    if not plane.magnitudes:
        return "-"
    return f"{plane.magnitudes[0]:g} to {plane.magnitudes[-1]:g} {plane.unit}".rstrip()


def _durations_text(plane: "ExploredPlane") -> str:
    return f"{plane.durations_s[0]:g} to {plane.durations_s[-1]:g} s"
