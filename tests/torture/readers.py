"""The readers of a run folder, and the part of their output that is compared."""

import io
import json
import re
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

import mutator
from mutator.cli.app import main
from mutator.errors import MutatorError

from .damages import contents

AUDITED = re.compile(
    r"(run|digests|checks|reviewed)\.json|campaign\.yaml|plan\.csv|plan/|golden/|records/|proof/|patches/|"
    r"series/[0-9a-f]{16}\.js$"
)
# verified if they exist
TABLES = ("results.csv", "results.parquet", "propagation.parquet", "timings.parquet")
HOW = re.compile(  # the parts of a report with timings
    r"^## (How the experiments were run|Where the time went)$.*?^(?=## )", re.MULTILINE | re.DOTALL
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    code: int
    said: str
    result: Any = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    folder: Path  # contains everything
    genuine: Path = Path()  # the undamaged run folder
    campaign: tuple[str, ...] = ()  # the words of its command, without `--out`
    experiment: str = ""  # one of its experiments
    shards: tuple[Path, ...] = ()

    @property
    def run(self) -> Path:
        return self.folder / "run"


Reader = Callable[[Place], Told]


def cli(*words: object) -> tuple[int, str, str]:
    out, err = (io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2))
    with redirect_stdout(out), redirect_stderr(err):
        code = main([str(word) for word in words])
    return code, _text(out), _text(err)


def _text(stream: io.TextIOWrapper) -> str:
    stream.seek(0)
    return stream.read()


def _told(words: tuple[object, ...], *files: Path, printed: bool = False) -> Told:
    code, out, err = cli(*words)
    written = [path.read_bytes() for path in files] if code == 0 else []
    return Told(code=code, said=out + err, result=[out if printed else "", *written])


def run(place: Place) -> Told:
    code, out, err = cli("run", *place.campaign, "--out", place.run, "-n", "0", "--json")
    if code != 0:
        return Told(code=code, said=out + err)
    found = json.loads(out)
    facts = [found[key] for key in ("planned", "done", "outcomes", "proof", "seal")]
    return Told(code=code, said=out + err, result=[facts, (place.run / "results.csv").read_bytes()])


def repair(place: Place) -> Told:
    code, out, err = cli("verify", place.run, "--repair")
    return run(place) if code in (0, 1) else Told(code=code, said=out + err)


def report(place: Place) -> Told:
    """Leave out the report's timings, which differ between runs."""
    words = ("report", place.run)
    told = _told(words, *(sorted((place.run / "report" / "tables").glob("*.csv"))), printed=True)
    if told.code != 0:
        return told
    text = (place.run / "report" / "REPORT.md").read_text()
    return Told(code=0, said=told.said, result=[told.result, HOW.sub("", text)])


def compare(place: Place) -> Told:
    out = place.folder / "compared"
    return _told(("compare", place.genuine, place.run, "--out", out), out / "pairs.csv", printed=True)


def show(place: Place) -> Told:
    return _told(("show", place.experiment, "--run", place.run, "--no-plot"), printed=True)


def show_plot(place: Place) -> Told:
    return _told(("show", place.experiment, "--run", place.run), printed=True)


def rerun(place: Place) -> Told:
    return _told(("rerun", place.experiment, "--run", place.run), printed=True)


def merge(place: Place) -> Told:
    out = place.folder / "merged"
    code, printed, err = cli("merge", *place.shards, "--out", out, "--json")
    if code != 0:
        return Told(code=code, said=printed + err)
    return Told(
        code=0, said=printed, result=[json.loads(printed)["seal"], (out / "results.csv").read_bytes()]
    )


def _export(format: str) -> Reader:
    def export(place: Place) -> Told:
        out = place.folder / f"exported.{format}"
        words = ("export", place.run, "--format", format, "--out", out)
        if format == "mcap":  # a folder of files
            told = _told(words)
            return Told(code=told.code, said=told.said, result=contents(out) if told.code == 0 else None)
        told = _told(words, out)
        if format != "parquet" or told.code != 0:
            return told
        return Told(code=0, said=told.said, result=pd.read_parquet(out).to_csv())

    return export


def verify(place: Place) -> Told:
    code, out, err = cli("verify", place.run)
    found, genuine = contents(place.run) if code == 0 else {}, contents(place.genuine)
    ledger = json.loads(genuine["digests.json"])
    known = [*ledger["files"], "digests.json"]
    # Nothing must be added to a finished run. The final files of an unfinished run are unknown.
    audited = {
        name: found[name] for name in found if name in known or (ledger["finished"] and AUDITED.match(name))
    }
    there = [name for name in TABLES if name in genuine]
    tables = {name: _table(place.run / name, place.genuine / name) for name in there if code == 0}
    return Told(code=code, said=out + err, result=audited | tables)


def _table(path: Path, genuine: Path) -> str | bytes:
    place = path if path.is_file() else genuine
    return pd.read_parquet(place).to_csv() if place.suffix == ".parquet" else place.read_bytes()


def expect(place: Place, seal: str) -> Told:
    code, out, err = cli("verify", place.run, "--expect", seal)
    return Told(code=code, said=out + err)


def api(place: Place) -> Told:
    try:
        found = mutator.load_run(place.run)
        told = [found.results.to_csv(), found.endings, found.seal, found.experiment(place.experiment).patch]
        return Told(code=0, said="", result=[*told, str(found.counts()), sorted(found.records)])
    except MutatorError as err:
        return Told(code=err.exit_code, said=f"{err}\nto do: {err.remedy or err.expected}")


def rows(place: Place) -> Told:
    """Return the rows of the results that the undamaged folder lacks: there must be none. A killed run can
    have fewer rows, because the same command runs the others again."""
    told = api(place)
    if told.code != 0:
        return told
    known = mutator.load_run(place.genuine).results.to_csv().splitlines()
    found = mutator.load_run(place.run).results.to_csv().splitlines()
    return Told(code=0, said=told.said, result=[row for row in found if row not in known])


READERS: dict[str, Reader] = {
    **{one.__name__: one for one in (run, repair, report, compare, show, show_plot)},
    **{one.__name__: one for one in (rerun, verify, api)},
    **{f"export {format}": _export(format) for format in mutator.Format},
}
