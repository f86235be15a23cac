"""Decisions about groups of mutants: a YAML file for version control, one block for each group, sorted.

A decision holds for what the reviewer saw: the group's diff, the target's functions, the templates. Their
digests are in the block; when one of them differs now, the group is `changed` and needs a new decision.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from enum import StrEnum
from pathlib import Path
from typing import Literal

from pydantic import Field

from mutator._common.files import make_folder, write_atomic
from mutator._common.shipped import refuse_shipped
from mutator.config.yaml_files import StrictModel, read
from mutator.errors import MutatorError
from mutator.review.catalogue import Bound, Group
from mutator.workspace import Workspace

SCHEMA = "review/1"
_HEAD = """\
# What reviewers said of the groups of mutants of this target: `mutator review` reads and writes this file.
# A decision holds while diff, function and template are those it was made about.
"""


class Verdict(StrEnum):
    """What a reviewer decided."""

    APPROVED = "approved"
    REJECTED = "rejected"


class State(StrEnum):
    """The state of a group's review, in the order in which groups are listed."""

    NEW = "new"  # nobody has decided
    CHANGED = "changed"  # since the decision
    REJECTED = "rejected"
    APPROVED = "approved"


@dataclass(frozen=True, slots=True, kw_only=True)
class Decision:
    """What `by` decided about a group, and digests of what it was then."""

    group: str
    what: str
    verdict: Verdict
    by: str
    remark: str
    bound: Bound

    def changed(self, group: Group) -> list[str]:
        """What of the group has changed since; empty: the decision holds."""
        return self.bound.changed(group.bound)

    @property
    def words(self) -> str:
        """Who decided what: `approved by Jane Doe: a remark`."""
        return f"{self.verdict} by {self.by}" + (f": {self.remark}" if self.remark else "")


class _DecisionModel(StrictModel):
    group: str = Field(pattern=r"^[0-9a-f]{12}$")
    what: str
    decision: Literal["approved", "rejected"]
    by: str = Field(pattern=r"\S")  # somebody must have looked
    remark: str
    diff: str = Field(pattern=r"^[0-9a-f]{16}$")
    function: str = Field(pattern=r"^[0-9a-f]{16}$")
    template: str = Field(pattern=r"^[0-9a-f]{16}$")


class _ReviewModel(StrictModel):
    target: str
    decisions: list[_DecisionModel]


@dataclass(frozen=True, kw_only=True)
class Review:
    """The decisions about one target's groups, by group; `path` is their file, which need not exist."""

    path: Path
    target: str
    decisions: Mapping[str, Decision]

    def state(self, group: Group) -> State:
        """The state of the group's review."""
        decision = self.decisions.get(group.id)
        if decision is None:
            return State.NEW
        return State.CHANGED if decision.changed(group) else State(decision.verdict.value)

    def in_turn(self, groups: Iterable[Group]) -> list[Group]:
        """The groups in the order of the list: new and changed ones first."""
        order = list(State)
        return sorted(groups, key=lambda group: order.index(self.state(group)))

    def describe(self, group: Group) -> str:
        """Who decided about the group, and what has changed since; empty for a new one."""
        decision = self.decisions.get(group.id)
        if decision is None:
            return ""
        changed = decision.changed(group)
        return decision.words + (f" (changed since: {', '.join(changed)})" if changed else "")

    def decided(self, groups: Iterable[Group], verdict: Verdict, by: str, remark: str) -> "Review":
        """The review with this decision about `groups`; MutatorError for an unusable name or remark."""
        by, remark = _line(by, "by"), _line(remark, "remark")
        if not by:
            raise MutatorError("no name", argument="by", expected="who has reviewed", remedy="give a name")
        made = {
            group.id: Decision(
                group=group.id, what=group.what, verdict=verdict, by=by, remark=remark, bound=group.bound
            )
            for group in groups
        }
        return Review(path=self.path, target=self.target, decisions={**self.decisions, **made})

    def write(self) -> None:
        """Write the file, whole or not at all; sorted, so that the work of two people can be merged.

        MutatorError in the library that ships with mutator, which stays as it is.
        """
        refuse_shipped(self.path)
        make_folder(self.path.parent)
        blocks = [_block(self.decisions[name]) for name in sorted(self.decisions)]
        entries = "\n" + "".join(blocks) if blocks else " []\n"
        text = f"{_HEAD}schema: {SCHEMA}\ntarget: {json.dumps(self.target)}\ndecisions:{entries}"
        write_atomic(self.path, text.encode())


def load_review(workspace: Workspace, target: str) -> Review:
    """The decisions about a target; none without a file. MutatorError at the line of a mistake."""
    path = workspace.library / "reviews" / f"{target}.yaml"
    if not path.exists():
        return Review(path=path, target=target, decisions={})
    model, source = read(path, _ReviewModel, SCHEMA)
    if model.target != target:
        raise source.error(
            ("target",), f"target '{model.target}'", expected=f"'{target}', as the file is named"
        )
    decisions: dict[str, Decision] = {}
    for i, entry in enumerate(model.decisions):
        if entry.group in decisions:
            raise source.error(
                ("decisions", i, "group"),
                f"group '{entry.group}' stands here a second time",
                expected="one decision about a group",
                remedy="keep the one that holds",
            )
        decisions[entry.group] = Decision(
            group=entry.group,
            what=entry.what,
            verdict=Verdict(entry.decision),
            by=entry.by,
            remark=entry.remark,
            bound=Bound(diff=entry.diff, function=entry.function, template=entry.template),
        )
    return Review(path=path, target=target, decisions=decisions)


def _block(decision: Decision) -> str:
    facts = {
        "group": decision.group,
        "what": decision.what,
        "decision": decision.verdict.value,
        "by": decision.by,
        "remark": decision.remark,
        **asdict(decision.bound),
    }
    lines = [f"{name}: {json.dumps(text, ensure_ascii=False)}\n" for name, text in facts.items()]
    return "  - " + "    ".join(lines)


def _line(text: str, argument: str) -> str:
    """Text as one line; MutatorError for characters that YAML cannot hold."""
    line = " ".join(text.split())
    if not line.isprintable():
        raise MutatorError(
            f"{line!r}", argument=argument, expected="plain text", remedy="leave out what is not"
        )
    return line
