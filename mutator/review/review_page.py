"""The review page: every group with its state, diff and values, in one self-contained file or served."""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from mutator._common.files import write_atomic
from mutator._common.hashing import as_json_types, content_id
from mutator.errors import MutatorError
from mutator.mutants.injected_line_syntax import tags_for_page_scripts
from mutator.review.group_display_texts import fault_value_table, title_lines, trigger_condition_lines
from mutator.review.image_effect_pictures import can_have_pictures
from mutator.review.mutant_groups import Group
from mutator.review.review_state_and_actions import Review, ReviewState
from mutator.web import asset_text, json_script_element, load_order, packed_script_element
from mutator.web.html_templates import html_environment


def write_review_page(
    out: Path, review: Review, groups: Sequence[Group], selecting_options: Sequence[str]
) -> None:
    """Write the page of `groups`; its commands include `options`, which select the groups."""
    try:
        write_atomic(out, review_page_html(review, groups, selecting_options).encode())
    except OSError as err:
        raise MutatorError(
            f"cannot be written ({err.strerror})", where=out, remedy="choose another file"
        ) from None


def review_page_html(
    review: Review,
    groups: Sequence[Group],
    selecting_options: Sequence[str],
    server_facts: Mapping[str, Any] | None = None,
) -> str:
    """Return the page of `groups`. `served` has what a served page needs: target, reviewer, address and token
    for decisions, runs.
    """
    data = {
        "target": review.target,
        "states": [state.value for state in ReviewState],
        "options": shlex.join(selecting_options),
        "groups": [
            _group_as_json(review, group, stack)
            for group, stack in _groups_with_stack_numbers(review, groups)
        ],
        "served": server_facts,
    }
    return render_review_page(data)


def render_review_page(data: dict[str, Any]) -> str:
    template = html_environment().from_string(asset_text("review/review.html"))
    return template.render(
        target=data["target"],
        count=len(data["groups"]),
        served=data.get("served") is not None,
        styles=[Markup(asset_text(name)) for name in load_order("review", ".css")],
        tags=Markup(json_script_element(tags_for_page_scripts(), "tags")),
        data=Markup(packed_script_element(data, "review")),
        scripts=[Markup(asset_text(name)) for name in load_order("review", ".js")],
    )


def group_review_as_json(review: Review, group: Group) -> dict[str, Any]:
    """Return the review of a group, as the page shows it. `digest` identifies the mutants, so that decisions
    from a page that shows other mutants are refused.
    """
    decision, flag = review.decision(group.id), review.flag(group.id)
    return {
        "state": review.state(group).value,
        "decision": decision
        and {
            "verdict": decision.verdict.value,
            "by": decision.by,
            "at": decision.at or "",
            "commit": decision.commit or "",
            "tool": decision.tool or "",
            "reason": decision.reason or "",
            "changed": review.stale_parts(group),
        },
        "remarks": [
            {"by": remark.by, "at": remark.at or "", "text": remark.text}
            for remark in review.remarks(group.id)
        ],
        "flag": flag and as_json_types(flag),
        "revision": review.revision(group.id),
        "digest": content_id([group.basis_digests, group.value_ranges])[:12],
    }


def _groups_with_stack_numbers(review: Review, groups: Sequence[Group]) -> list[tuple[Group, int]]:
    """Return the groups with stack numbers, in stack order. The groups of a stack share state, template,
    function and called code.
    """
    stack_by_key: dict[tuple[object, ...], int] = {}
    numbered = []
    for group in groups:
        stack_key = (
            review.state(group),
            group.files,
            group.functions,
            group.models,
            group.basis_digests.calls,
        )
        numbered.append((group, stack_by_key.setdefault(stack_key, len(stack_by_key))))
    return sorted(numbered, key=lambda pair: pair[1])


def _group_as_json(review: Review, group: Group, stack_number: int) -> dict[str, Any]:
    heads, rows = fault_value_table(group)
    return group_review_as_json(review, group) | {
        "id": group.id,
        "like": stack_number,
        "titles": title_lines(group),
        "injections": group.injection_labels,
        "words": group.fault_descriptions,
        "specs": group.specs,
        "trigger": group.trigger_kinds,
        "hold": group.hold_kinds,
        "conditions": trigger_condition_lines(group.triggers),
        "faults": len(group.faults),
        "runs": group.experiment_count,
        "diff": group.diff,
        "changes": review.diff_since_decision(group),
        "pictures": can_have_pictures(group),
        "heads": heads,
        "rows": rows,
        "units": group.unit_by_parameter,
    }
