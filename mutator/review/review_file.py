"""The file of a target's reviews: YAML for version control, one sorted block for each group.

Blocks of `review/1`, which had a group for each kind of trigger, are converted.
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from mutator._common.hashing import content_id
from mutator.config.yaml_files import Source, StrictModel, read
from mutator.review.entries import Bound, Decision, Entry, Flag, Remark, Verdict

SCHEMA = "review/2"
_FIRST = "review/1"
_HEAD = """\
# Reviews of this target's groups of mutants. `mutator review` reads and writes this file.
# A decision is valid while diff, function, template and calls are unchanged and all values are in its ranges.
"""
_WHEN = re.compile(r"; (?:always|time|state), (?:while|for|to_end)\Z")  # at the end of `what` in review/1
_DIGEST = r"^[0-9a-f]{16}$"
_TIME = r"^\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ$"
_DIFFERS = "0" * 16  # for digests that differ between merged old decisions, which makes the decision invalid
_NEEDED = ("by", "diff", "function", "template")


class _RemarkModel(StrictModel):
    by: str = Field(pattern=r"\S")
    at: str | None = Field(None, pattern=_TIME)
    text: str = Field(pattern=r"\S")


class _FlagModel(StrictModel):
    by: str = Field(pattern=r"\S")
    at: str = Field(pattern=_TIME)


class _BlockModel(StrictModel):
    group: str = Field(pattern=r"^[0-9a-f]{12}$")
    what: str
    decision: Literal["approved", "rejected"] | None = None
    by: str | None = Field(None, pattern=r"\S")
    at: str | None = Field(None, pattern=_TIME)
    commit: str | None = Field(None, pattern=r"^[0-9a-f]{40,64}(-dirty)?$")
    tool: str | None = None
    diff: str | None = Field(None, pattern=_DIGEST)
    function: str | None = Field(None, pattern=_DIGEST)
    template: str | None = Field(None, pattern=_DIGEST)
    calls: str | None = Field(None, pattern=_DIGEST)
    values: dict[str, list[float | int | str]] | None = None
    remarks: list[_RemarkModel] = Field(default_factory=list)
    flag: _FlagModel | None = None


class _FileModel(StrictModel):
    target: str
    four_eyes: bool = False
    decisions: list[_BlockModel]


@dataclass(frozen=True, slots=True, kw_only=True)
class Content:
    entries: Mapping[str, Entry]
    four_eyes: bool = False


def load(path: Path, target: str) -> Content:
    """Read an existing file for `target`; MutatorError, with the line, for a mistake."""
    model, source = read(path, _FileModel, SCHEMA, older={_FIRST: _from_first})
    if model.target != target:
        raise source.error(
            ("target",), f"target '{model.target}'", expected=f"'{target}', as in the file name"
        )
    entries: dict[str, Entry] = {}
    for i, block in enumerate(model.decisions):
        if block.group in entries:
            raise source.error(
                ("decisions", i, "group"),
                f"group '{block.group}' appears twice",
                expected="one block for each group",
                remedy="keep the valid one",
            )
        entries[block.group] = _entry(block, source, i)
    if source.data["schema"] == _FIRST:
        entries = _merged(target, entries.values())
    return Content(entries=entries, four_eyes=model.four_eyes)


def text(target: str, content: Content) -> str:
    """Return the text of a file, sorted so that git can merge parallel work."""
    blocks = [_block(content.entries[name]) for name in sorted(content.entries)]
    head = f"schema: {SCHEMA}\ntarget: {json.dumps(target)}\n" + "four_eyes: true\n" * content.four_eyes
    return f"{_HEAD}{head}decisions:" + ("\n" + "".join(blocks) if blocks else " []\n")


def _entry(block: _BlockModel, source: Source, i: int) -> Entry:
    given = block.model_dump(include={"by", "at", "commit", "tool", "diff", "function", "template", "calls"})
    given["values"] = block.values
    if block.decision is None:
        if extra := [name for name, value in given.items() if value is not None]:
            raise source.error(
                ("decisions", i, extra[0]),
                f"'{extra[0]}' without a decision",
                expected="`decision: approved` or `rejected` with it",
                remedy="add the decision, or remove its fields",
            )
    elif missing := [name for name in _NEEDED if given[name] is None]:
        raise source.error(
            ("decisions", i),
            f"a decision without `{missing[0]}`",
            expected=f"{', '.join(f'`{name}`' for name in _NEEDED)} with it",
            remedy="decide again with `mutator review`, which computes the digests",
        )
    return Entry(
        group=block.group,
        what=block.what,
        decision=_decision(block) if block.decision else None,
        remarks=tuple(Remark(by=one.by, at=one.at, text=one.text) for one in block.remarks),
        flag=Flag(by=block.flag.by, at=block.flag.at) if block.flag else None,
    )


def _decision(block: _BlockModel) -> Decision:
    values = block.values
    return Decision(
        group=block.group,
        what=block.what,
        verdict=Verdict(str(block.decision)),
        by=str(block.by),
        at=block.at,
        commit=block.commit,
        tool=block.tool,
        bound=Bound(
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


def _block(entry: Entry) -> str:
    facts: dict[str, Any] = {"group": entry.group, "what": entry.what}
    if entry.decision:
        kept = asdict(entry.decision)
        names = ("by", "at", "commit", "tool")
        facts |= {"decision": kept["verdict"], **{name: kept[name] for name in names}, **kept["bound"]}
        facts["values"] = kept["values"]
    if entry.flag:
        facts["flag"] = asdict(entry.flag)
    lines = [f"{name}: {_json(value)}\n" for name, value in facts.items() if value is not None]
    if entry.remarks:
        lines += ["remarks:\n", *(f"  - {_json(_given(one))}\n" for one in entry.remarks)]
    return "  - " + "    ".join(lines)


def _given(remark: Remark) -> dict[str, str]:
    return {name: value for name, value in asdict(remark).items() if value is not None}


def _json(value: Any) -> str:
    """Return the value as one line of JSON, which is also YAML."""
    return json.dumps(value, ensure_ascii=False)


# `review/1`: a group for each kind of trigger, a remark with the decision


def _from_first(source: Source) -> Source:
    """Convert the blocks of a `review/1` file; invalid parts are left unchanged."""
    blocks = source.data.get("decisions")
    if not isinstance(blocks, list):
        return source
    made = [_new_block(block) if isinstance(block, dict) else block for block in blocks]
    return replace(source, data={**source.data, "decisions": made})


def _new_block(block: dict[str, Any]) -> dict[str, Any]:
    remark = block.get("remark")
    if not isinstance(remark, str) or not isinstance(block.get("by"), str):
        return block
    kept = {name: value for name, value in block.items() if name != "remark"}
    return kept | ({"remarks": [{"by": block["by"], "text": remark}]} if remark.strip() else {})


def _merged(target: str, entries: Iterable[Entry]) -> dict[str, Entry]:
    """Merge the entries of groups that differed only in the kind of trigger."""
    found: dict[tuple[str, str], list[Entry]] = {}
    for entry in entries:
        what = _WHEN.sub("", entry.what)
        known = entry.group == content_id([target, entry.what])[:12]
        key = (content_id([target, what])[:12], what) if known else (entry.group, entry.what)
        found.setdefault(key, []).append(entry)
    return {group: _one(group, what, parts) for (group, what), parts in found.items()}


def _one(group: str, what: str, parts: Sequence[Entry]) -> Entry:
    """Merge decisions: rejected if any part was rejected, else approved. `by` names all reviewers with that
    verdict.
    """
    decisions = [entry.decision for entry in parts if entry.decision]
    remarks = tuple(dict.fromkeys(remark for entry in parts for remark in entry.remarks))
    counting = [one for one in decisions if one.verdict is Verdict.REJECTED] or decisions
    if not counting:
        return Entry(group=group, what=what, remarks=remarks)
    names = dict.fromkeys(one.by for one in counting)
    first = counting[0]
    bound = {
        name: digest if all(getattr(one.bound, name) == digest for one in counting) else _DIFFERS
        for name, digest in asdict(first.bound).items()
    }
    decision = replace(first, group=group, what=what, by=" and ".join(names), bound=Bound(**bound))
    return Entry(group=group, what=what, decision=decision, remarks=remarks)
