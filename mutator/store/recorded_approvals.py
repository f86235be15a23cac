"""`reviewed.json`: the decisions that allowed a run with `--require-reviewed`."""

from collections import Counter
from pathlib import Path
from typing import Any

from mutator._common.files import json_bytes, read_json
from mutator._common.hashing import digest
from mutator._common.message_text import counted
from mutator.errors import MutatorError
from mutator.store import file_digests
from mutator.store.run_head import DAMAGED_RUN_REMEDY

APPROVALS_SCHEMA, APPROVALS_FILE = "reviewed/1", "reviewed.json"
_DIGEST_SCHEMA = "review-digest/1"


def write_approvals(run: Path, approvals: dict[str, Any]) -> None:
    file_digests.rewrite_file(run, APPROVALS_FILE, json_bytes(approvals))


def review_digest(run: Path) -> str | None:
    """Return the digest of a run's decisions (who decided what about which diff); None without any."""
    if not (run / APPROVALS_FILE).is_file():
        return None
    return digest([_DIGEST_SCHEMA, read_json(run / APPROVALS_FILE, APPROVALS_SCHEMA)])


def approval_summary(run: Path) -> str:
    """Who approved a run's mutants, as text; empty without `--require-reviewed`."""
    if not (run / APPROVALS_FILE).exists():
        return ""
    groups: Any = read_json(run / APPROVALS_FILE, APPROVALS_SCHEMA).get("groups")
    try:
        names = Counter(str(group["by"]) for group in groups)
    except (TypeError, KeyError):
        raise MutatorError(
            "damaged at 'groups'", where=run / APPROVALS_FILE, remedy=DAMAGED_RUN_REMEDY
        ) from None
    return f"{counted(len(groups), 'group')} approved by " + ", ".join(
        f"{name} ({n})" for name, n in sorted(names.items())
    )
