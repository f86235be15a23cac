"""Write hazards as SARIF 2.1.0, for code scanning and viewers: a result for each hazardous experiment, at the
place of its fault.

Results of the same experiment have the same fingerprint in each run, so a dismissed alert stays dismissed.
"""

import json
import warnings
from collections.abc import Sequence
from typing import Any
from urllib.parse import quote

from mutator._common.version import VERSION
from mutator.campaigns.fault_positions import SourcePosition
from mutator.errors import MutatorError, MutatorWarning
from mutator.exports import Export, ExportRequest
from mutator.exports.code_findings import CodeFinding, hazard_findings
from mutator.faults.fault_models import FaultModels
from mutator.operators.operator_lookup import find_operator, operator_name_of

SARIF_VERSION = "2.1.0"
SARIF_SCHEMA = "https://docs.oasis-open.org/sarif/sarif/v2.1.0/errata01/os/schemas/sarif-schema-2.1.0.json"
MOST_RESULTS = 25_000  # GitHub refuses files with more
_REPOSITORY_ROOT = "%SRCROOT%"  # the name by which tools know it


def _sarif_json(request: ExportRequest) -> bytes:
    assert request.workspace is not None
    findings = hazard_findings(request)
    if len(findings) > MOST_RESULTS:
        warnings.warn(
            f"left out, because code scanning takes at most {MOST_RESULTS:,} results: "
            f"{len(findings) - MOST_RESULTS:,} of {len(findings):,} hazards, the mildest",
            MutatorWarning,
            stacklevel=2,
        )
    log = sarif_log(request, findings[:MOST_RESULTS], request.workspace.fault_models())
    return (json.dumps(log, ensure_ascii=False, indent=1) + "\n").encode()


def sarif_log(request: ExportRequest, findings: Sequence[CodeFinding], models: FaultModels) -> dict[str, Any]:
    """Return the findings as a SARIF log with one run."""
    head = request.folder.head
    finding_by_rule = {finding.rule: finding for finding in findings}
    rules = sorted(finding_by_rule)
    driver = {
        "name": "mutator",
        "semanticVersion": VERSION,
        "rules": [_rule_as_json(finding_by_rule[name], models) for name in rules],
    }
    run = {
        "tool": {"driver": driver},
        "automationDetails": {"id": f"mutator/{quote(head.campaign)}/"},
        "columnKind": "unicodeCodePoints",
        "results": [_result_as_json(f, rules.index(f.rule), request) for f in findings],
        "properties": {"campaign": head.campaign, "target": head.target, "plan": head.plan},
    }
    return {"$schema": SARIF_SCHEMA, "version": SARIF_VERSION, "runs": [run]}


def _rule_as_json(finding: CodeFinding, models: FaultModels) -> dict[str, Any]:
    is_operator = operator_name_of(finding.experiment.fault) is not None
    try:
        about = find_operator(finding.rule).about if is_operator else models.get(finding.rule).about
    except MutatorError:  # not installed, or no longer in the templates
        about = ""
    kind = "Mutation operator" if is_operator else "Fault model"
    return {
        "id": finding.rule,
        "shortDescription": {"text": f"{kind} {finding.rule}: a hazard follows"},
        "fullDescription": {"text": about or finding.rule},
        "defaultConfiguration": {"level": "warning"},
        "properties": {"tags": ["fault-injection"]},
    }


def _result_as_json(finding: CodeFinding, rule_index: int, request: ExportRequest) -> dict[str, Any]:
    experiment, row = finding.experiment, finding.row
    function = experiment.fault.injections[0].location.function
    first, *others = finding.positions
    location = _location_as_json(first)
    if function:
        location["logicalLocations"] = [{"fullyQualifiedName": function, "kind": "function"}]
    properties = {
        "experiment": experiment.id,
        "scenario": experiment.scenario,
        "trigger": experiment.trigger.name,
        "hazards": [name for name, _ in row.hazards],
        "severity": row.severity,
        "alerts": list(row.alerts),
    }
    return {
        "ruleId": finding.rule,
        "ruleIndex": rule_index,
        "level": finding.levels.sarif,
        "message": {"text": finding.message},
        "locations": [location],
        **({"relatedLocations": list(map(_location_as_json, others))} if others else {}),
        # the second is the only name that GitHub reads
        "partialFingerprints": {"experiment/v1": experiment.id, "primaryLocationLineHash": experiment.id},
        **({"baselineState": "new"} if request.selection.base is not None else {}),
        "properties": properties,
    }


def _location_as_json(position: SourcePosition) -> dict[str, Any]:
    return {
        "physicalLocation": {
            "artifactLocation": {"uri": quote(position.path), "uriBaseId": _REPOSITORY_ROOT},
            "region": {"startLine": position.first_line, "endLine": position.last_line},
        }
    }


EXPORT = Export(
    about="SARIF for code scanning",
    file="sarif.sarif",
    write=_sarif_json,
    options=frozenset({"base"}),
    needs_library=True,
)
