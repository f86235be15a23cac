"""Lines of a plan: as this version writes them, as others do, and forged or damaged ones."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from hashlib import sha256

import pytest

from mutator._common.hashing import as_json_types, canonical_json
from mutator.errors import MutatorError
from mutator.model import AfterHazard, Experiment, Hold
from mutator.store.plan_file import experiment_as_json
from mutator.store.plan_lines import (
    experiment_from_json,
    fault_from_json,
    id_on_line,
    parse_canonical_experiment,
    parse_experiment,
    parse_fault,
    values_hashed_into_id,
)

Make = Callable[..., Experiment]


def line_of(experiment: Experiment) -> bytes:
    return canonical_json(experiment_as_json(experiment)).encode() + b"\n"


def with_id_of_its_text(line: bytes) -> bytes:
    """Return the line with the digest of its values as they are written."""
    values = dict(
        re.findall(rb'"(fault|scenario|scenario_digest|method|seed|setting)":("[^"]*"|\\[.*?\\]|[^,]+)', line)
    )
    values[b"trigger"] = line[line.index(b'"trigger":') + 10 : -2]
    names = (b"fault", b"scenario", b"scenario_digest", b"method", b"trigger", b"seed", b"setting")
    digest = sha256(b"[%b]" % b",".join(values[name] for name in names)).hexdigest()[:16]
    return line.replace(id_on_line(line).encode(), digest.encode())


def test_a_line_in_the_usual_format_is_read_fast(experiment: Make) -> None:
    """Any other line takes the slow path."""
    for planned in (
        experiment(),
        experiment(2.5, changes=("no_lead",)),
        replace(experiment(), setting=("a", "b")),
    ):
        faults = {planned.fault.id: planned.fault}
        line = canonical_json(experiment_as_json(planned)).encode() + b"\n"
        found = parse_canonical_experiment(line, faults)
        assert found == experiment_from_json(json.loads(line), faults) == planned
        assert found.id == planned.id and "id" in vars(found)
        for old, new in (
            (b'"seed":', b'"seed":1'),
            (b'"method":', b'"method": '),
            (b"hwt <=", b"hwt <"),
            (b'"name":', b'"Name":'),
        ):
            assert old in line and parse_canonical_experiment(line.replace(old, new), faults) is None
        assert parse_canonical_experiment(line, {}) is None
    stopping = canonical_json(experiment_as_json(replace(planned, after_hazard=AfterHazard.STOP))).encode()
    assert parse_canonical_experiment(stopping, faults) is None


def test_a_missing_field_of_an_older_plan_has_its_default(experiment: Make) -> None:
    planned = experiment()
    planned = replace(planned, trigger=replace(planned.trigger, armed_after_s=0.0))
    line = experiment_as_json(planned)
    del line["trigger"]["armed_after_s"], line["trigger"]["hold_s"]
    read = experiment_from_json(line, {planned.fault.id: planned.fault})
    assert (read.trigger.armed_after_s, read.trigger.hold_s, read.trigger.hold) == (0.0, None, Hold.WHILE)


def test_an_end_is_a_time_of_a_run_that_can_stop(experiment: Make) -> None:
    ending = replace(experiment(), after_hazard=AfterHazard.STOP, end_s=20.5)
    faults = {ending.fault.id: ending.fault}
    assert experiment_from_json(experiment_as_json(ending), faults) == ending
    for values in (
        {"end_s": "t"},
        {"end_s": 20},
        {"end_s": -1.0},
        {"end_s": 1e300},
        {"after_hazard": "go_on"},
    ):
        with pytest.raises(ValueError, match="an end that no run can have"):
            experiment_from_json(experiment_as_json(ending) | values, faults)


@pytest.mark.parametrize("where", ["experiment", "trigger", "fault", "injection", "anchor"])
def test_an_unknown_field_of_a_newer_plan_is_refused(experiment: Make, where: str) -> None:
    """An unknown field could change the experiment."""
    planned = experiment()
    fault, line = as_json_types(planned.fault), experiment_as_json(planned)
    injection = fault["injections"][0]
    places = {"experiment": line, "trigger": line["trigger"], "fault": fault, "injection": injection}
    places["anchor"] = injection["location"]["anchor"]
    places[where]["repeat"] = 2
    with pytest.raises(MutatorError, match=f"{where} has 'repeat', .* does not know"):
        known = fault_from_json(fault)
        experiment_from_json(line, {line["fault"]: known})


SPELLINGS = [  # a number as canonical JSON, and as other JSON of the same value
    ("1e-05", "1e-5"),
    ("1e-05", "0.00001"),
    ("1.0", "1.00"),
    ("1e+22", "1e22"),
    ("36893488147419103232", "36893488147419103232.0"),
    ("Infinity", "1e999"),
    ("-Infinity", "-1e999"),
]


@pytest.mark.parametrize(("written", "other"), SPELLINGS)
def test_an_id_is_the_digest_of_canonical_numbers(experiment: Make, written: str, other: str) -> None:
    """Otherwise an experiment could have several ids, and be counted several times."""
    planned = experiment()
    planned = replace(planned, trigger=replace(planned.trigger, hold_s=json.loads(written)))
    faults, line = {planned.fault.id: planned.fault}, line_of(planned)
    found = parse_canonical_experiment(line, faults)
    assert found == planned and found.id == planned.id == id_on_line(line)
    spelled = line.replace(f'"hold_s":{written},'.encode(), f'"hold_s":{other},'.encode())
    forged = with_id_of_its_text(spelled)
    assert with_id_of_its_text(line) == line != spelled and id_on_line(forged) != planned.id
    with pytest.raises(MutatorError, match=r"has the content of"):
        parse_experiment(forged, faults)
    if type(json.loads(other)) is type(json.loads(written)):
        assert parse_experiment(spelled, faults).id == planned.id


@pytest.mark.parametrize("seed", [0, -1, 2**70, 10**400])
def test_a_seed_can_have_any_size(experiment: Make, seed: int) -> None:
    planned = replace(experiment(), seed=seed)
    found = parse_canonical_experiment(line_of(planned), {planned.fault.id: planned.fault})
    assert found is not None and (found.seed, found.id) == (seed, planned.id)


def test_minus_zero_is_no_seed(experiment: Make) -> None:
    planned = replace(experiment(), seed=0)
    forged = with_id_of_its_text(line_of(planned).replace(b'"seed":0', b'"seed":-0'))
    with pytest.raises(MutatorError, match="has the content of"):
        parse_experiment(forged, {planned.fault.id: planned.fault})


@pytest.mark.parametrize("surrogate", [b"\\ud800", b"\xed\xa0\x80", b"\xff"])
@pytest.mark.parametrize("text", [b"S1", b"hwt"])
def test_text_without_a_utf_8_form_has_no_id(experiment: Make, surrogate: bytes, text: bytes) -> None:
    planned = experiment()
    line = with_id_of_its_text(line_of(planned).replace(text, surrogate))
    with pytest.raises(MutatorError, match="a damaged line"):
        parse_experiment(line, {planned.fault.id: planned.fault})


def test_an_experiment_has_the_id_that_its_line_states(experiment: Make) -> None:
    """A second id, or one inside the trigger, does not replace it."""
    planned = experiment()
    faults, line = {planned.fault.id: planned.fault}, line_of(planned)
    other = b'"id":"%b"' % (b"0" * 16)
    for forged in (
        line.replace(b"}\n", b",%b}\n" % other),
        line.replace(b'{"fault"', b'{%b,"fault"' % other),
    ):
        stated = id_on_line(forged)
        try:
            assert parse_experiment(forged, faults).id == stated
        except MutatorError as err:
            assert stated in err.got
    reordered = json.dumps(dict(reversed(experiment_as_json(planned).items()))).encode()
    assert id_on_line(reordered) == parse_experiment(reordered, faults).id == planned.id


@pytest.mark.parametrize(
    "line", [b"", b"{}", b"[]", b"3", b'"id"', b"\xff", b'{"id":3}', b'{"id":"../x"}', b"[" * 10_000]
)
def test_a_damaged_line_is_refused_by_every_reader(line: bytes) -> None:
    for read in (id_on_line, values_hashed_into_id, parse_fault, lambda line: parse_experiment(line, {})):
        with pytest.raises(MutatorError, match="a damaged line; the plan is damaged: restore"):
            read(line)
