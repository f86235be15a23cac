"""Write a run as a mutation testing report (the mutation-testing-elements schema, version 2).

A mutant is a fault at its first location; its tests are runs. A fault that led to a hazard *survived*,
because the controller did not handle it; one that was active without a hazard was *killed*. A high score is
therefore good for the controller, and only a score of 100 % is green. A drive that did not end is a
*RuntimeError*, because viewers count a *Timeout* as detected.
"""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from mutator._common.message_text import counted
from mutator._common.version import VERSION
from mutator.campaigns.fault_positions import numbered_lines
from mutator.execution import single_run
from mutator.exports import Export, ExportRequest
from mutator.exports.code_findings import rule_name_of
from mutator.faults.fault_models import FaultModels, SnippetKind
from mutator.model import OPERATOR_FAULTS_MODULE, Experiment, Fault, Injection, Outcome, Record, Status
from mutator.mutants.changeable_expressions import parenthesized_if_splittable
from mutator.mutants.injection_edits import edits_of
from mutator.mutants.parsed_files_and_anchors import ParsedFile, parsed_file
from mutator.mutants.splicing import EditRank, ExpressionEdit, LineEdit, sort_edits
from mutator.store import plan_file
from mutator.store.run_folder import RunFolder
from mutator.targets.manifest import TargetManifest

SCHEMA_VERSION = "2.0"
_MOST_LISTED_DRIVES = 5  # in the reason of a mutant's status


def _report_json(request: ExportRequest) -> bytes:
    workspace = request.workspace
    assert workspace is not None
    manifest = single_run.manifest_of_unchanged_target(workspace, request.folder)
    content = mutation_report(request.folder, manifest, workspace.fault_models())
    return (json.dumps(content, ensure_ascii=False) + "\n").encode()


def mutation_report(folder: RunFolder, manifest: TargetManifest, models: FaultModels) -> dict[str, Any]:
    records = folder.records()
    experiments_by_fault: dict[str, list[Experiment]] = {}
    for experiment in plan_file.load_experiments(folder.path):
        experiments_by_fault.setdefault(experiment.fault.id, []).append(experiment)
    files: dict[str, dict[str, Any]] = {}
    for experiments in experiments_by_fault.values():
        fault = experiments[0].fault
        file = parsed_file(manifest.tree, fault.injections[0].location.path)
        source = file.data.decode(file.encoding)
        entry = files.setdefault(file.path, {"language": "python", "source": source, "mutants": []})
        entry["mutants"].append(_mutant_as_json(manifest, models, fault, experiments, records))
    head = folder.head
    config = {
        "campaign": head.campaign,
        "target": head.target,
        "seed": head.seed,
        "reading": head.reading,
        "plan": head.plan,
        "sources": head.sources,
        **({"seeds": head.seeds} if head.seeds else {}),
    }
    return {
        "schemaVersion": SCHEMA_VERSION,
        "thresholds": {"high": 100, "low": 0},
        "framework": {"name": "mutator", "version": VERSION},
        "config": config,
        "files": dict(sorted(files.items())),
        "testFiles": _test_files_as_json([e for group in experiments_by_fault.values() for e in group]),
    }


def _mutant_as_json(
    manifest: TargetManifest,
    models: FaultModels,
    fault: Fault,
    experiments: Sequence[Experiment],
    records: Mapping[str, Record],
) -> dict[str, Any]:
    others = fault.injections[1:]
    also = [f"{i.location.path}:{_line_number(manifest, i)}" for i in others]
    description = ", aims at ".join(filter(None, (fault.label, fault.aim)))
    description += f"; also at {', '.join(also)}" if also else ""
    return {
        "id": fault.id,
        "mutatorName": rule_name_of(fault),
        "description": description,
        **_replacement_of(manifest, models, fault),
        **mutant_status_as_json(experiments, records),
    }


def _line_number(manifest: TargetManifest, injection: Injection) -> int:
    return numbered_lines(parsed_file(manifest.tree, injection.location.path), injection)[0]


def _replacement_of(manifest: TargetManifest, models: FaultModels, fault: Fault) -> dict[str, Any]:
    first = fault.injections[0]
    file, model = parsed_file(manifest.tree, first.location.path), models.get(first.model)
    edit, span = edits_of(manifest, models, [first])[0].edit, file.line_span(first.location)
    if isinstance(edit, ExpressionEdit):
        # `parenthesized_if_splittable` adds parentheses if an adjacent operator could bind more tightly
        return _replacement_at(file, edit.start, edit.end, parenthesized_if_splittable(edit.changed))
    if (
        fault.module == OPERATOR_FAULTS_MODULE and model.kind is SnippetKind.GUARD
    ):  # the mutant omits the statement
        line, last = file.lines[span[0]], file.lines[span[1] - 1].rstrip(b"\r\n")
        start = len(line) - len(line.lstrip())
        return _replacement_at(file, (span[0], start), (span[1] - 1, len(last)), "pass")
    return _replacement_of_lines(file, span, [edit])


def _replacement_at(
    file: ParsedFile, start: tuple[int, int], end: tuple[int, int], replacement: str
) -> dict[str, Any]:
    """Return a replacement of the text from `start` to `end` (line and byte, from 0), in the schema's
    positions: lines and characters, from 1.
    """
    first, last = (
        {"line": line + 1, "column": len(file.lines[line][:column].decode(file.encoding)) + 1}
        for line, column in (start, end)
    )
    return {"location": {"start": first, "end": last}, "replacement": replacement}


def _replacement_of_lines(
    file: ParsedFile, span: tuple[int, int], edits: Sequence[LineEdit]
) -> dict[str, Any]:
    """Replace all anchored lines (at a function's entry, the line after the insertion)."""
    first = min(span[0], *(edit.line_index for edit in edits), len(file.lines) - 1)
    last = max(span[1], first + 1)
    lines, new_lines, copied_to = file.lines[first:last], list[bytes](), 0
    for edit in sort_edits(edits):
        at = edit.line_index - first
        replaced_to = at + (1 if edit.rank is EditRank.INSTEAD else edit.indented_line_count)
        new_lines += [
            *lines[copied_to:at],
            *edit.lines,
            *(edit.indent_unit + line for line in lines[at : at + edit.indented_line_count]),
        ]
        copied_to = replaced_to
    new_lines += lines[copied_to:]
    replacement = b"".join(new_lines).rstrip(b"\r\n").decode(file.encoding)
    return _replacement_at(file, (first, 0), (last - 1, len(lines[-1].rstrip(b"\r\n"))), replacement)


def mutant_status_as_json(experiments: Sequence[Experiment], records: Mapping[str, Record]) -> dict[str, Any]:
    """Return a fault's status over its runs, its reason, the runs that activated it and, if it was killed,
    those that withstood it.
    """
    recorded = {e: records[e.id] for e in experiments if e.id in records}
    missing = len(experiments) - len(recorded)
    unjudged = [
        record
        for record in recorded.values()
        if record.status is Status.LEFT_OUT or record.outcome is Outcome.NOT_JUDGED
    ]
    record_by_experiment = {e: r for e, r in recorded.items() if r not in unjudged}
    records_by_status = {
        status: [r for r in record_by_experiment.values() if r.status is status] for status in Status
    }
    hazardous = [e for e, r in record_by_experiment.items() if r.hazards]
    active = [e for e, r in record_by_experiment.items() if r.activation]
    drives = counted(len(experiments) - len(unjudged), "drive")
    if hazardous:
        names = sorted({name for e in hazardous for name, _ in record_by_experiment[e].hazards})
        status, reason = "Survived", f"{', '.join(names)} in {len(hazardous)} of {drives}"
        reason += f": {_joined_names([e.drive_label for e in hazardous])}"
    elif missing:
        status, reason = "Pending", f"not run yet: {missing} of {drives}"
    elif records_by_status[Status.INVALID_MUTANT]:
        status, reason = "CompileError", records_by_status[Status.INVALID_MUTANT][0].detail
    elif records_by_status[Status.CRASHED]:
        status, reason = "RuntimeError", records_by_status[Status.CRASHED][0].detail
    elif records_by_status[Status.TIMEOUT]:
        status, reason = "RuntimeError", records_by_status[Status.TIMEOUT][0].detail
    elif records_by_status[Status.HARNESS_ERROR] and not records_by_status[Status.OK]:
        status, reason = (
            "Ignored",
            f"harness errors only: {records_by_status[Status.HARNESS_ERROR][0].detail}",
        )
    elif not record_by_experiment:
        status, reason = "Ignored", unjudged[0].detail
    elif active:
        differing = sum(r.outcome is Outcome.SDC for r in records_by_status[Status.OK])
        status, reason = "Killed", f"no hazard; an actuator output differed in {differing} of {drives}"
    else:
        status, reason = "NoCoverage", f"never active in {drives}"
    return {
        "status": status,
        "statusReason": reason,
        "coveredBy": [e.drive_label for e in active],
        "killedBy": [e.drive_label for e in active] if status == "Killed" else [],
        "testsCompleted": len(records_by_status[Status.OK]),
    }


def _joined_names(names: Sequence[str]) -> str:
    """Return the names joined by `; `; only the first few of many."""
    more = len(names) - _MOST_LISTED_DRIVES
    return "; ".join(names[:_MOST_LISTED_DRIVES]) + (f"; and {more} more" if more > 0 else "")


def _test_files_as_json(experiments: Sequence[Experiment]) -> dict[str, Any]:
    files: dict[str, Any] = {}
    for scenario, name in sorted({(e.family_or_scenario, e.drive_label) for e in experiments}):
        files.setdefault(scenario, {"tests": []})["tests"].append({"id": name, "name": name})
    return files


EXPORT = Export(
    about="JSON for viewers of mutation reports",
    file="mutation-elements.json",
    write=_report_json,
    needs_library=True,
)
