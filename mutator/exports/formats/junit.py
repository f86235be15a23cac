"""Write a run as JUnit XML: a suite for each fault type, a case for each experiment.

Experiments with a result pass, unless their outcome is listed as a failure. Harness errors and invalid
mutants are errors; experiments that have not run, were never active or cannot be judged are skipped. `file`
and `line` are the place of the fault in the target's source, `time` is the wall time of the run in s.
"""

import re
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

from mutator.campaigns.fault_positions import FaultPositions
from mutator.errors import MutatorError, MutatorWarning
from mutator.exports import Export, ExportRequest
from mutator.model import Experiment, Outcome, Status
from mutator.results.plan_columns import plan_row
from mutator.results.result_rows import ResultRow
from mutator.results.table_reader import Results
from mutator.store.plan_file import load_experiments

ENDINGS_THAT_CAN_FAIL = (Outcome.HAZARD, Outcome.SDC, Outcome.MASKED, Status.CRASHED, Status.TIMEOUT)
_NOT_XML_PATTERN = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def _junit_xml(request: ExportRequest) -> bytes:
    """Return the XML. MutatorError for an outcome that cannot be a failure."""
    folder, failures = request.folder, request.selection.failures
    names = [ending.value for ending in ENDINGS_THAT_CAN_FAIL]
    if unknown := [name for name in failures if name not in names]:
        raise MutatorError(f"'{unknown[0]}'", argument="failures", expected=f"one of {', '.join(names)}")
    rows = {row.experiment_id: row for row in Results.up_to_date(folder.path).rows()}
    cases = _TestCases(rows, folder.timings(), _positions_if_unchanged(request), failures)
    suites: dict[str, list[Experiment]] = {}
    for experiment in load_experiments(folder.path):
        cells = plan_row(experiment)
        suites.setdefault(f"{cells['module']}/{cells['fault_type']}", []).append(experiment)
    root = ET.Element("testsuites", name=folder.head.campaign)
    for name in sorted(suites):
        suite = ET.SubElement(root, "testsuite", name=name)
        suite.extend(map(cases.element, suites[name]))
        _set_suite_sums(suite)
    _set_suite_sums(root)
    ET.indent(root)
    data: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return data + b"\n"


def _positions_if_unchanged(request: ExportRequest) -> FaultPositions | None:
    """Return the places of the faults; None without a library, and with a warning if the target changed."""
    if request.workspace is None:
        return None
    try:
        return FaultPositions.of_run(request.folder, request.workspace)
    except MutatorError as err:
        warnings.warn(f"JUnit without files and lines: {err}", MutatorWarning, stacklevel=2)
        return None


@dataclass(frozen=True, slots=True)
class _TestCases:
    """Builds the case of each experiment, from its row and its timing line."""

    rows: Mapping[str, ResultRow]
    timings: Mapping[str, dict[str, Any]]
    positions: FaultPositions | None
    failures: Collection[str]

    def element(self, experiment: Experiment) -> ET.Element:
        row = self.rows.get(experiment.id)
        case = ET.Element("testcase", self._attributes(experiment))
        facts = {"experiment": experiment.id, "ending": row.ending if row else "not run"}
        if row:
            facts |= {f"hazard {name} [s]": f"{t:.2f}" for name, t in row.hazards}
            facts |= {"alerts": ", ".join(row.alerts)} if row.alerts else {}
            facts |= {"sentence": row.sentence} if row.sentence else {}
        properties = ET.SubElement(case, "properties")
        for name, value in facts.items():
            ET.SubElement(properties, "property", name=name, value=_xml_text(value))
        if row is None:
            ET.SubElement(case, "skipped", message="not run yet")
        elif row.ending in (Status.LEFT_OUT, Outcome.NOT_JUDGED):
            ET.SubElement(case, "skipped", message=_xml_text(row.detail))
        elif not row.usable:
            ET.SubElement(case, "error", type=row.ending, message=_xml_text(row.detail))
        elif row.ending == Outcome.NOT_ACTIVATED:
            ET.SubElement(case, "skipped", message="the fault was never active")
        elif row.ending in self.failures:
            ET.SubElement(case, "failure", type=row.ending, message=_xml_text(row.summary))
        return case

    def _attributes(self, experiment: Experiment) -> dict[str, str]:
        attributes = {"classname": experiment.fault.spec.replace("/", "."), "name": experiment.label}
        if self.positions is not None:
            first = self.positions.of_fault(experiment.fault)[0]
            attributes |= {"file": _xml_text(first.path), "line": str(first.first_line)}
        if timing := self.timings.get(experiment.id):
            attributes["time"] = f"{timing['wall_s']:.3f}"
        return attributes


def _set_suite_sums(element: ET.Element) -> None:
    element.set("tests", str(len(list(element.iter("testcase")))))
    for attribute, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        element.set(attribute, str(len(list(element.iter(tag)))))
    times = [float(case.get("time", 0.0)) for case in element.iter("testcase")]
    element.set("time", f"{sum(times):.3f}")


def _xml_text(text: str) -> str:
    return _NOT_XML_PATTERN.sub("?", text)


EXPORT = Export(
    about="JUnit XML for CI servers",
    file="junit.xml",
    write=_junit_xml,
    options=frozenset({"failures"}),
    uses_library=True,
)
