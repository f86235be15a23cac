"""The file of a target's reviews: YAML for version control, one sorted block for each group."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from mutator.config.yaml_files import StrictModel, YamlRecord, load_yaml_model
from mutator.config.yaml_source_lines import YamlSource
from mutator.review.review_entries import (
    TIME_PATTERN,
    BasisDigests,
    DecisionVerdict,
    Flag,
    GroupDecision,
    Remark,
    ReviewEntry,
)

SCHEMA = "review/2"
_FILE_HEADER = """\
# Reviews of this target's groups of mutants. `mutator review` reads and writes this file.
# A decision is valid while diff, function, template and calls are unchanged and all values are in its ranges.
"""
_DIGEST_PATTERN = r"^[0-9a-f]{16}$"  # as `content_id` returns them
_REQUIRED_KEYS = ("by", "diff", "function", "template")  # older files lack the other ones


class _BlockModel(StrictModel):
    group: str = Field(pattern=r"^[0-9a-f]{12}$")
    what: str
    decision: Literal["approved", "rejected"] | None = None
    by: str | None = Field(None, pattern=r"\S")
    at: str | None = Field(None, pattern=TIME_PATTERN)
    reason: str | None = Field(None, pattern=r"\S")
    commit: str | None = Field(None, pattern=r"^[0-9a-f]{40,64}(-dirty)?$")
    tool: str | None = None
    diff: str | None = Field(None, pattern=_DIGEST_PATTERN)
    function: str | None = Field(None, pattern=_DIGEST_PATTERN)
    template: str | None = Field(None, pattern=_DIGEST_PATTERN)
    calls: str | None = Field(None, pattern=_DIGEST_PATTERN)
    values: dict[str, list[float | int | str]] | None = None
    remarks: list[YamlRecord[Remark]] = Field(default_factory=list)
    flag: YamlRecord[Flag] | None = None


class _FileModel(StrictModel):
    target: str
    four_eyes: bool = False
    decisions: list[_BlockModel]


@dataclass(frozen=True, slots=True, kw_only=True)
class ReviewFileContent:
    entry_by_group: Mapping[str, ReviewEntry]
    four_eyes: bool = False


def load_review_file(path: Path, target: str) -> ReviewFileContent:
    """Read an existing file for `target`; MutatorError, with the line, for a mistake."""
    model, source = load_yaml_model(path, _FileModel, SCHEMA)
    if model.target != target:
        raise source.error(
            ("target",), f"target '{model.target}'", expected=f"'{target}', as in the file name"
        )
    entries: dict[str, ReviewEntry] = {}
    for i, block in enumerate(model.decisions):
        if block.group in entries:
            raise source.error(
                ("decisions", i, "group"),
                f"group '{block.group}' appears twice",
                expected="one block for each group",
                remedy="keep the valid one",
            )
        entries[block.group] = _parse_entry(block, source, i)
    return ReviewFileContent(entry_by_group=entries, four_eyes=model.four_eyes)


def render_review_file(target: str, content: ReviewFileContent) -> str:
    """Return the text of a file, sorted so that git can merge parallel work."""
    blocks = [_render_block(content.entry_by_group[name]) for name in sorted(content.entry_by_group)]
    head = f"schema: {SCHEMA}\ntarget: {json.dumps(target)}\n" + "four_eyes: true\n" * content.four_eyes
    return f"{_FILE_HEADER}{head}decisions:" + ("\n" + "".join(blocks) if blocks else " []\n")


def _parse_entry(block: _BlockModel, source: YamlSource, i: int) -> ReviewEntry:
    decision_fields = block.model_dump(
        include={"by", "at", "reason", "commit", "tool", "diff", "function", "template", "calls"}
    )
    decision_fields["values"] = block.values
    if block.decision is None:
        if extra := [name for name, value in decision_fields.items() if value is not None]:
            raise source.error(
                ("decisions", i, extra[0]),
                f"'{extra[0]}' without a decision",
                expected="`decision: approved` or `rejected` with it",
                remedy="add the decision, or remove its fields",
            )
    elif missing := [name for name in _REQUIRED_KEYS if decision_fields[name] is None]:
        raise source.error(
            ("decisions", i),
            f"a decision without `{missing[0]}`",
            expected=f"{', '.join(f'`{name}`' for name in _REQUIRED_KEYS)} with it",
            remedy="decide again with `mutator review`, which computes the digests",
        )
    if block.reason is not None and block.decision != "rejected":
        raise source.error(
            ("decisions", i, "reason"),
            "a reason for an approval",
            expected="`reason` only with `decision: rejected`",
            remedy="move the text to `remarks`",
        )
    return ReviewEntry(
        group=block.group,
        what=block.what,
        decision=_parse_decision(block) if block.decision else None,
        remarks=tuple(block.remarks),
        flag=block.flag,
    )


def _parse_decision(block: _BlockModel) -> GroupDecision:
    values = block.values
    return GroupDecision(
        group=block.group,
        what=block.what,
        verdict=DecisionVerdict(str(block.decision)),
        by=str(block.by),
        at=block.at,
        reason=block.reason,
        commit=block.commit,
        tool=block.tool,
        bound=BasisDigests(
            diff=str(block.diff),
            function=str(block.function),
            template=str(block.template),
            calls=block.calls,
        ),
        values=None
        if values is None
        else {
            name: tuple(v if isinstance(v, str) else float(v) for v in row) for name, row in values.items()
        },
    )


def _render_block(entry: ReviewEntry) -> str:
    facts: dict[str, Any] = {"group": entry.group, "what": entry.what}
    if entry.decision:
        decision = asdict(entry.decision)
        names = ("by", "at", "reason", "commit", "tool")
        facts |= {
            "decision": decision["verdict"],
            **{name: decision[name] for name in names},
            **decision["bound"],
        }
        facts["values"] = decision["values"]
    if entry.flag:
        facts["flag"] = asdict(entry.flag)
    lines = [f"{name}: {_json_line(value)}\n" for name, value in facts.items() if value is not None]
    if entry.remarks:
        lines += ["remarks:\n", *(f"  - {_json_line(_remark_as_json(remark))}\n" for remark in entry.remarks)]
    return "  - " + "    ".join(lines)


def _remark_as_json(remark: Remark) -> dict[str, str]:
    return {name: value for name, value in asdict(remark).items() if value is not None}


def _json_line(value: Any) -> str:
    """Return the value as one line of JSON, which is also YAML."""
    return json.dumps(value, ensure_ascii=False)
