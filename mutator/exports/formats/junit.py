"""Write a run as JUnit XML: a suite for each fault type, a case for each experiment.

Experiments with a result pass, unless their outcome is listed as a failure. Harness errors and invalid
mutants are errors; experiments that have not run or were never active are skipped.
"""

import re
import xml.etree.ElementTree as ET
from collections.abc import Collection

from mutator.errors import MutatorError
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
    suites: dict[str, list[Experiment]] = {}
    for experiment in load_experiments(folder.path):
        cells = plan_row(experiment)
        suites.setdefault(f"{cells['module']}/{cells['fault_type']}", []).append(experiment)
    root = ET.Element("testsuites", name=folder.head.campaign)
    for name in sorted(suites):
        suite = ET.SubElement(root, "testsuite", name=name)
        for experiment in suites[name]:
            suite.append(_test_case_element(experiment, rows.get(experiment.id), failures))
        _set_suite_counts(suite)
    _set_suite_counts(root)
    ET.indent(root)
    data: bytes = ET.tostring(root, encoding="utf-8", xml_declaration=True)
    return data + b"\n"


def _test_case_element(
    experiment: Experiment, row: ResultRow | None, failures: Collection[str]
) -> ET.Element:
    case = ET.Element("testcase", classname=experiment.fault.spec.replace("/", "."), name=experiment.label)
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
    elif not row.usable:
        ET.SubElement(case, "error", type=row.ending, message=_xml_text(row.detail))
    elif row.ending == Outcome.NOT_ACTIVATED:
        ET.SubElement(case, "skipped", message="the fault was never active")
    elif row.ending in failures:
        hazards = ", ".join(f"{name} at {t:.2f} s" for name, t in row.hazards)
        ET.SubElement(
            case,
            "failure",
            type=row.ending,
            message=_xml_text(row.sentence or hazards or row.detail or row.ending),
        )
    return case


def _set_suite_counts(element: ET.Element) -> None:
    element.set("tests", str(len(list(element.iter("testcase")))))
    for attribute, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        element.set(attribute, str(len(list(element.iter(tag)))))


def _xml_text(text: str) -> str:
    return _NOT_XML_PATTERN.sub("?", text)


EXPORT = Export(
    about="JUnit XML for CI servers", file="junit.xml", write=_junit_xml, options=frozenset({"failures"})
)
