"""Write hazards as a code quality report of GitLab: an entry for each hazardous experiment, at the place of
its fault.
"""

import json
from typing import Any

from mutator.exports import Export, ExportRequest
from mutator.exports.code_findings import CodeFinding, hazard_findings


def _code_quality_json(request: ExportRequest) -> bytes:
    entries = list(map(_entry_as_json, hazard_findings(request)))
    return (json.dumps(entries, ensure_ascii=False, indent=1) + "\n").encode()


def _entry_as_json(finding: CodeFinding) -> dict[str, Any]:
    position = finding.positions[0]
    return {
        "description": finding.message,
        "check_name": finding.rule,
        "fingerprint": finding.experiment.id,
        "severity": finding.levels.code_quality,
        "location": {
            "path": position.path,
            "lines": {"begin": position.first_line, "end": position.last_line},
        },
    }


EXPORT = Export(
    about="JSON for GitLab's code quality report",
    file="codequality.json",
    write=_code_quality_json,
    options=frozenset({"base"}),
    needs_library=True,
)
