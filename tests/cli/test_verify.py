"""`verify` and the seal that it compares."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mutator.errors import MutatorError
from mutator.store.run_folder import RunFolder
from mutator.store.series_format import encode_series
from mutator.store.series_packing import EncodedSeries, SeriesWriter, pack_series
from mutator.store.time_series_folder import SeriesIndex, TimeSeriesFolder, write_rerun_series

Cli = Callable[..., Any]  # runs `mutator WORDS...`; returns code, out, err, json


def series_of(name: str) -> object:
    run = Path("run")
    return TimeSeriesFolder(run).load_series(name, RunFolder.open_unverified(run).records()[name])


def test_an_audit_is_printed_on_one_page(cli: Cli, sealed: str) -> None:
    found = cli("verify", "run", "--rerun", 2, "--expect", sealed)
    assert (found.code, found.err) == (0, "")
    assert found.out.rstrip().endswith("no difference") and len(found.out.splitlines()) < 50
    facts = dict(re.findall(r"^(\S[^\n]*?)  +(\S.*)$", found.out.split("\n\n")[0], re.MULTILINE))
    assert facts["seal"] == sealed and "Python 3." in facts["python"] and facts["mutator"].startswith("0.")
    assert {"packages", "drawn at random", "results digest"} <= facts.keys()
    assert re.search(r"^not sealed:\n(.+\n)*platform ", found.out, re.MULTILINE)
    assert "seal as expected" in found.out and "--expect" not in found.out
    as_json = cli("verify", "run", "--json").json
    assert (as_json["passed"], as_json["seal"]) == (True, sealed)
    assert sum(check["count"] for check in as_json["checks"]) > 20


def test_an_audit_takes_the_seal_or_the_results_digest_and_says_which(cli: Cli, sealed: str) -> None:
    found = cli("verify", "run", "--json").json
    assert found["not_sealed"].keys() >= {"platform", "other files"} and not found["review_digest"]
    other = cli("verify", "run", "--expect", found["results_digest"])
    assert other.code == 0 and "results digest as expected" in other.out
    assert cli("verify", "run", "--expect", "0" * 64).code == 1
    assert "shows only an expected seal (--expect)" in cli("verify", "run").out


def test_the_seal_is_in_the_output_and_the_report(cli: Cli, sealed: str) -> None:
    again = cli("run", "small", "--out", "run", "-n", "0", "--json")
    assert (again.code, again.json["ran"], again.json["seal"]) == (0, 0, sealed)
    told = Path("run/report/REPORT.md").read_text()
    assert f"| seal | {sealed} |" in told and f"| results digest | {again.json['results_digest']} |" in told
    assert "| platform | " in told.partition("### Not sealed")[2]
    planned = cli("plan", "small", "--out", "planned")
    assert planned.code == 0
    assert cli("verify", "planned").code == 0
    assert cli("verify", "planned", "--expect", sealed).code == 1


def test_verify_repairs_a_damaged_run_and_run_completes_it(cli: Cli, sealed: str) -> None:
    records, patch = next(Path("run/records").iterdir()), next(Path("run/patches").iterdir())
    golden = next(Path("run/golden").rglob("log.npz"))
    lines = records.read_bytes().splitlines(keepends=True)
    records.write_bytes(
        b"".join([*lines[:1], lines[1].replace(b'"status":"ok"', b'"status":"OK"'), *lines[2:]])
    )
    patch.write_bytes(patch.read_bytes()[:-9])
    golden.write_bytes(b"other")
    found = cli("verify", "run", "--repair")
    assert found.code == 1 and found.err == ""
    for text in ("a damaged line", "log.npz: changed", "repaired: ", "patches: no patch of "):
        assert text in found.out
    again = cli("run", "small", "--out", "run", "-n", "0")
    assert again.code == 0, again.err
    assert f"seal: {sealed}" in again.out
    assert cli("verify", "run", "--expect", sealed).code == 0


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


def packed() -> SeriesIndex:
    index = TimeSeriesFolder(Path("run")).index
    assert index is not None
    return index


def chunks() -> dict[str, str]:
    (goldens, _), (experiments, _) = packed().chunk_entry_counts
    return {"goldens": f"{goldens}.js", "experiments": f"{experiments}.js", "index": "index.js"}


@pytest.mark.parametrize("damage", [flip, Path.unlink], ids=["damaged", "missing"])
@pytest.mark.parametrize(
    "what", ["goldens", *(pytest.param(name, marks=pytest.mark.slow) for name in ("experiments", "index"))]
)
def test_rerun_restores_damaged_series(
    cli: Cli, sealed: str, what: str, damage: Callable[[Path], None]
) -> None:
    before = {path.name: path.read_bytes() for path in Path("run/series").iterdir()}
    name, *others = packed().entry_number_by_experiment
    file = Path("run/series") / chunks()[what]
    damage(file)
    found = cli("verify", "run")
    assert found.code == 1 and "1 difference" in found.out
    told = " ".join(found.out.split())
    assert f"- series/{file.name}: " in told and "--repair` sets the file aside" in told
    assert "`mutator rerun ID --trace" in told
    if what != "index":
        assert f"the series of {name} and {len(others)} more cannot be read" in told
    made = cli("rerun", name, "--trace", "--run", "run")
    assert made.code == 0, made.err
    whole = series_of(name)
    assert whole is not None
    if what != "index" or damage is flip:
        with pytest.raises(MutatorError, match=f"rerun the experiment: `mutator rerun {others[0]} --trace"):
            series_of(others[0])
    repaired = cli("verify", "run", "--repair")
    assert repaired.code == 1 and f"repaired: series/{file.name}" in repaired.out
    if what != "index":  # the rerun experiment's series can be read
        left = f"the series of {others[0]} and {len(others) - 1} more cannot be read"
        assert left in " ".join(repaired.out.split())
    assert (Path("run/damaged/series") / file.name).exists() == (damage is flip)
    assert cli("verify", "run", "--expect", sealed).code == 0
    assert series_of(name) is not None
    if what == "goldens":
        after = {path.name: path.read_bytes() for path in Path("run/series").glob("*.js")}
        assert after == before
    else:
        assert series_of(others[0]) is None
        assert cli("rerun", others[0], "--trace", "--run", "run").code == 0
        assert series_of(others[0]) is not None


def test_the_audit_names_the_command_that_restores_a_series(cli: Cli, sealed: str) -> None:
    name = next(iter(packed().entry_number_by_experiment))
    assert cli("show", name, "--run", "run", "--plot").code == 0
    kept = TimeSeriesFolder(Path("run")).rerun_series_path(name)
    assert cli("rerun", name, "--trace", "--run", "run").code == 0
    data = kept.read_bytes()
    flip(kept)
    found = cli("verify", "run")
    assert found.code == 1 and f"- series/kept/{name}.js: damaged; " in found.out
    assert f"`mutator rerun {name} --trace" in found.out
    assert cli("show", name, "--run", "run", "--plot").code == 0
    assert kept.read_bytes() == data
    assert cli("verify", "run").code == 0


def test_the_series_of_another_run_is_not_used(cli: Cli, sealed: str) -> None:
    """The audit names it, and commands refuse it."""
    one, other, *_ = RunFolder.open(Path("run")).records()
    assert cli("rerun", one, "--trace", "--run", "run").code == 0
    kept = TimeSeriesFolder(Path("run")).rerun_series_path(one)
    script = kept.read_bytes().replace(one.encode(), other.encode(), 1)
    kept.with_name(f"{other}.js").write_bytes(script)
    with pytest.raises(MutatorError, match="the series of another run"):
        series_of(other)
    found = cli("verify", "run")
    assert found.code == 1 and f"series/kept/{other}.js: the series of another run" in found.out
    kept.with_name(f"{other}.js").unlink()
    assert cli("verify", "run", "--expect", sealed).code == 0


def curves_of_golden(name: str) -> tuple[bytes, bytes]:
    """A forged series: everything as in the record, but the values of the golden run."""
    found = TimeSeriesFolder(Path("run")).load_series(
        name, RunFolder.open_unverified(Path("run")).records()[name]
    )
    assert found is not None
    golden, faulty = found
    return encode_series(golden), encode_series(replace(golden, facts=faulty.facts), golden)


def deviating() -> str:
    records = RunFolder.open(Path("run")).records()
    return next(name for name, one in records.items() if any(by for _, by in one.max_dev))


def pack_with(name: str, forged: bytes) -> None:
    """Pack the series again, under new names and with an index, with another series of one experiment."""
    there, index = TimeSeriesFolder(Path("run")), packed()
    writer = SeriesWriter(Path("run"), "forged")
    for one in index.entry_number_by_experiment:
        key = index.golden_by_experiment[one]
        golden, faulty = [
            there.read_entry(number)
            for number in (index.entry_number_by_golden[key], index.entry_number_by_experiment[one])
        ]
        writer.append(
            one,
            EncodedSeries(
                golden_key=key, golden_bytes=golden, faulty_bytes=forged if one == name else faulty
            ),
        )
    writer.close()
    for path in Path("run/series").glob("*.js"):
        path.unlink()
    pack_series(
        Path("run"),
        index.plan,
        {one: place for place, one in enumerate(index.entry_number_by_experiment)},
        index.budget_mb,
    )


def test_curves_of_the_golden_run_are_not_shown_as_those_of_a_fault(cli: Cli, sealed: str) -> None:
    """Whether they are in a rerun's file or in a chunk with a new name and index."""
    name, there = deviating(), TimeSeriesFolder(Path("run"))
    golden, forged = curves_of_golden(name)
    write_rerun_series(there.rerun_series_path(name), golden, forged)
    found = cli("verify", "run")
    assert found.code == 1 and f"- series/kept/{name}.js: the series of another run: " in found.out
    with pytest.raises(MutatorError, match="the series of another run"):
        series_of(name)
    there.rerun_series_path(name).unlink()
    pack_with(name, forged)
    found = cli("verify", "run")
    assert found.code == 1 and f"{name}: the series of another run: " in found.out
    with pytest.raises(MutatorError, match="the series of another run"):
        series_of(name)


def test_a_packed_series_that_is_none_is_reported(cli: Cli, sealed: str) -> None:
    """Also if its chunk has the right name."""
    name = deviating()
    pack_with(name, b"no series")
    found = cli("verify", "run")
    assert found.code == 1 and "1 difference" in found.out and f": {name}: " in found.out
    with pytest.raises(MutatorError):
        series_of(name)


def test_a_rerun_s_golden_curves_must_be_those_of_the_golden_run(cli: Cli, sealed: str) -> None:
    name, there = deviating(), TimeSeriesFolder(Path("run"))
    found = there.load_series(name, RunFolder.open_unverified(Path("run")).records()[name])
    assert found is not None
    golden, faulty = (
        replace(one, channel_values=[row + np.float32(1e-3) for row in one.channel_values]) for one in found
    )
    write_rerun_series(there.rerun_series_path(name), encode_series(golden), encode_series(faulty, golden))
    audit = cli("verify", "run")
    assert audit.code == 1 and f"series/kept/{name}.js: differs; expected the series of golden/" in audit.out


def test_damaged_blocks_of_patches_are_reported(cli: Cli, sealed: str) -> None:
    """Every patch can still be read, because the damaged block is the first of two equal ones."""
    [patches] = Path("run/patches").iterdir()
    data = patches.read_bytes()
    patches.write_bytes(data[:40] + b"?" + data[41:] + data)
    found = cli("verify", "run", "--repair")
    assert found.code == 1 and f"- patches/{patches.name}: damaged blocks; " in found.out
    assert f"repaired: patches/{patches.name}: damaged blocks set aside" in found.out
    assert cli("verify", "run", "--expect", sealed).code == 0


def test_the_audit_lists_only_some_of_many_differences(cli: Cli, sealed: str, root: Path) -> None:
    table = Path("run/results.csv")
    table.write_text("\n" * 60)
    found = cli("verify", "run")
    assert found.code == 1
    assert len(found.out.splitlines()) < 70 and re.search(r"^- and \d+ more$", found.out, re.MULTILINE)
    tables = cli("verify", "run", "--json").json["checks"][-1]
    assert len(tables["differences"]) > 50


def test_an_audit_with_another_target_does_not_pass(cli: Cli, sealed: str, root: Path) -> None:
    with (root / "tree" / "toycar" / "driver.py").open("a") as file:
        file.write("\n")
    found = cli("verify", "run", "--expect", sealed)
    assert found.code == 1
    assert "(trees and patches were not compared)" in found.out and "toycar/driver.py" in found.out
    assert "trees and patches" not in found.out.split("- ")[0]


def test_without_the_target_digests_and_tables_are_compared(
    cli: Cli, sealed: str, tmp_path: Path, monkeypatch: Any
) -> None:
    monkeypatch.delenv("MUTATOR_ROOT")
    found = cli("verify", "run", "--json")
    assert found.code == 1
    failed = [check["what"] for check in found.json["checks"] if check["differences"]]
    assert failed == ["sources that match those of the run"]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("verify", "nosuch"), "not a run folder"),
        (("verify", "run", "--expect", "36251d8d"), "--expect: '36251d8d'"),
        (("verify", "run", "--rerun", "-1"), "--rerun"),
    ],
)
def test_wrong_input_is_refused(cli: Cli, sealed: str, words: tuple[str, ...], told: str) -> None:
    found = cli(*words)
    assert found.code == 2 and told in found.err


def test_an_edited_page_is_found_when_the_report_is_built_again(cli: Cli, copy: Path) -> None:
    assert cli("verify", copy, "--report").code == 0
    page = copy / "report" / "index.html"
    page.write_text(page.read_text().replace("</body>", "<p>No hazards.</p></body>"))
    (copy / "report" / "more.html").write_text("<p>All is well.</p>")
    found = cli("verify", copy, "--report")
    assert found.code == 1
    assert "index.html: differs from the page built now" in found.out
    assert "more.html: not part of the report" in found.out
    assert cli("verify", copy).code == 0
