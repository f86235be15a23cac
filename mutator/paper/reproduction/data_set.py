"""The data set of the study: every experiment of every campaign, with what is needed to read and cite it."""

import gzip
import io
import re
import shutil
import zlib
from collections.abc import Collection, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from mutator._common.bounded_reading import decompress_bounded, read_bounded
from mutator._common.files import make_folder, remove_anything_at, write_atomic
from mutator._common.hashing import digest
from mutator.errors import MutatorError
from mutator.paper.reproduction.study_campaigns import StudyCampaign
from mutator.paper.reproduction.study_tables import HEADS, Row, StudyTables
from mutator.results.table_columns import result_columns_of
from mutator.results.table_reader import Results, is_same_parquet
from mutator.statistics.results_frame import load_usable_results
from mutator.statistics.sample_weights import WEIGHT_COLUMN
from mutator.statistics.statistics_sheet import Sheet
from mutator.store.run_folder import RunFolder

if TYPE_CHECKING:
    import pandas as pd

MOST_BYTES = 30_000_000
_CAMPAIGN_COLUMN = "campaign"
_LEFT_OUT_COLUMNS = ("sentence",)  # words that follow from the other columns
_MARKDOWN_LINK = re.compile(r"\[([^\]]+)\]\([^)]*\)")
_SUMS_FILE = "SHA256SUMS"
_README = Path(__file__).parent / "pages" / "data-set.md"


def write_data_set(
    folder: Path,
    clone_root: Path,
    campaigns: Sequence[StudyCampaign],
    run_folders: Mapping[str, RunFolder],
    tables: StudyTables,
) -> list[Row]:
    """Write the data set into a new folder; return its files with sizes and digests. MutatorError if it is
    larger than `MOST_BYTES`.

    A campaign without a run folder has been driven elsewhere: the rows of its files are those of `tables`,
    and files that were brought from there stay.
    """
    elsewhere = files_of_campaigns(each for each in campaigns if each.name not in run_folders)
    make_folder(folder)
    for path in folder.iterdir():
        if path.name not in elsewhere:
            remove_anything_at(path)
    for name, run_folder in run_folders.items():
        frame = _experiments(name, run_folder)
        parquet, csv, dictionary = _files_of_campaign(name)
        frame.to_parquet(folder / parquet, compression="zstd", index=False)
        write_atomic(folder / csv, _gzipped_csv(frame))
        write_atomic(folder / dictionary, _dictionary(run_folder).as_csv().encode())
    for name, data in tables.file_bytes().items():
        if name != "data_set.csv":
            write_atomic(folder / name, data)
            _write_parquet(folder / name.replace(".csv", ".parquet"), name, tables)
    for name in ("LICENSE", "CITATION.cff"):
        shutil.copyfile(clone_root / name, folder / name)
    write_atomic(folder / "README.md", _readme(tables).encode())
    rows = [_row(path) for path in folder.iterdir() if path.name not in elsewhere]
    rows += [row for row in tables.rows("data_set") if row["file"] in elsewhere]
    rows.sort(key=lambda row: row["file"])
    write_atomic(folder / _SUMS_FILE, _sums(rows))
    if (size := sum(int(row["bytes"]) for row in rows)) > MOST_BYTES:
        raise MutatorError(f"a data set of {size:,} bytes", where=folder, expected=f"at most {MOST_BYTES:,}")
    return rows


def _readme(tables: StudyTables) -> str:
    text = read_bounded(_README).decode()
    for column in ("commit", "tables_commit"):
        commits = sorted({row[column] for row in tables.rows("runs")})
        text = text.replace(f"{{{column}}}", ", ".join(commits))
    return text


def _row(path: Path) -> Row:
    data = read_bounded(path)
    return {"file": path.name, "bytes": str(len(data)), "sha256": digest(data)}


def files_of_campaigns(campaigns: Iterable[StudyCampaign]) -> set[str]:
    """Return the files that only these campaigns give."""
    return {name for campaign in campaigns for name in _files_of_campaign(campaign.name)}


def _files_of_campaign(name: str) -> tuple[str, str, str]:
    """Return the files of a campaign: its experiments as Parquet and as compressed CSV, and their columns."""
    return f"experiments_{name}.parquet", f"experiments_{name}.csv.gz", f"dictionary_{name}.csv"


def differing_files(folder: Path, rows: Sequence[Row], may_be_missing: Collection[str] = ()) -> list[str]:
    """Return the files of a data set that differ from their digests, are missing, or have none."""
    expected = {row["file"]: row["sha256"] for row in rows} | {_SUMS_FILE: digest(_sums(rows))}
    digests = {p.name: digest(read_bounded(p)) if p.is_file() else "" for p in folder.glob("*")}
    return [
        name
        for name in sorted({*expected, *digests})
        if expected.get(name) != digests.get(name) and (name in digests or name not in may_be_missing)
    ]


def has_same_content(path: Path, genuine: Path) -> bool:
    """Return whether a file has the content of another one, however they are compressed."""
    if not genuine.is_file():
        return False
    if path.suffix == ".parquet":
        return is_same_parquet(path, genuine)
    data, expected = read_bounded(path), read_bounded(genuine)
    if path.suffix != ".gz" or data == expected:
        return data == expected
    text = gzip.decompress(expected)
    try:
        return decompress_bounded(data, len(text), gzip=True) == text
    except (ValueError, zlib.error):
        return False


def _sums(rows: Iterable[Row]) -> bytes:
    return "".join(f"{row['sha256']}  {row['file']}\n" for row in rows).encode()


def _experiments(campaign: str, run_folder: RunFolder) -> "pd.DataFrame":
    results = Results.up_to_date(run_folder.path).frame()
    results = results[[name for name in results.columns if name not in _LEFT_OUT_COLUMNS]]
    results.insert(0, _CAMPAIGN_COLUMN, campaign)
    results[WEIGHT_COLUMN] = results["experiment_id"].map(_weights(run_folder))
    return results


def _weights(folder: RunFolder) -> "pd.Series":
    """Return the weight of each usable experiment by id: 1 in a whole campaign."""
    usable = load_usable_results(folder.path / "results.csv").set_index("experiment_id")
    return usable.assign(**{WEIGHT_COLUMN: usable.get(WEIGHT_COLUMN, 1.0)})[WEIGHT_COLUMN]


def _gzipped_csv(frame: "pd.DataFrame") -> bytes:
    """Return the frame as CSV, compressed to the same bytes every time."""
    out = io.BytesIO()
    with gzip.GzipFile(filename="", fileobj=out, mode="wb", mtime=0) as file:
        file.write(frame.to_csv(index=False, lineterminator="\n").encode())
    return out.getvalue()


def _dictionary(run_folder: RunFolder) -> Sheet:
    columns = [
        (column.name, column.type, column.unit, _MARKDOWN_LINK.sub(r"\1", column.about))
        for column in result_columns_of(run_folder)
        if column.name not in _LEFT_OUT_COLUMNS
    ]
    first = (_CAMPAIGN_COLUMN, "text", "", "the campaign of `runs.csv`")
    about = "how many planned experiments it stands for; 1 in a whole campaign, empty without a usable result"
    last = (WEIGHT_COLUMN, "number", "", about)
    return Sheet(
        name="dictionary",
        title="",
        note="",
        heads=("column", "type", "unit", "meaning"),
        lines=(first, *columns, last),
    )


def _write_parquet(path: Path, name: str, tables: StudyTables) -> None:
    import pandas as pd

    table = name.removesuffix(".csv")
    frame = pd.DataFrame(tables.rows(table), columns=list(HEADS[table]), dtype=str)
    frame.to_parquet(path, compression="zstd", index=False)
