"""The files and folders that a run folder can contain, by name."""

from fnmatch import fnmatchcase

from mutator._common.library_and_run_folder_search import SCRATCH_FOLDER
from mutator.store import file_digests
from mutator.store.run_head import CAMPAIGN_FILE, HEAD

DAMAGED_FOLDER, TRACES_FOLDER = "damaged", "traces"
DEFENDED_FOLDER = "defended"  # with a run folder for each set of defences
SIGNATURE_FILES = ("seal.json", "seal.json.sig")
_EXPORTED_TABLES = ("results", "propagation", "timings")
ALLOWED_FILE_GLOBS = (  # all files that a run folder can contain; * matches any text, including folders
    *(
        HEAD,
        file_digests.DIGESTS_FILE,
        CAMPAIGN_FILE,
        "plan.csv",
        "plan/*.jsonl",
        "reviewed.json",
        "checks.json",
        "progress.json",
        "envelopes.json",
    ),
    *SIGNATURE_FILES,
    *("golden/*/*", "golden/*.packed", "patches/*.blocks"),
    *("records/*.jsonl", "timings/*.jsonl", "proof/*.jsonl"),
    "executed/*.jsonl",
    f"{DEFENDED_FOLDER}/*",
    *("series/*.js", "series/*.blocks"),
    *(f"{TRACES_FOLDER}/*/*", *(f"plots/*.{kind}" for kind in ("svg", "jpg", "png", "mp4", "gif"))),
    *("results.csv", "results.parquet", "propagation.parquet", "timings.parquet", "results.json"),
    *(
        "report/*.md",
        "report/*.html",
        "report/made_from.json",
        "report/run_before.json",
        "report/random_searches.json",
        "report/series/*.js",
    ),
    *("report/tables/*.csv", "report/figures/*.svg", "report/figures/*.png", "report/compare-*/*.csv"),
    f"report/{DEFENDED_FOLDER}/*",
    *(
        "exports/mcap/*.mcap",
        "exports/*-report.html",
        *(f"exports/{name}.{kind}" for name in _EXPORTED_TABLES for kind in ("csv", "parquet")),
    ),
    *(f"{DAMAGED_FOLDER}/*", "owner.lock", "workers/*", f"{SCRATCH_FOLDER}/*"),
)
ALLOWED_TOP_FOLDERS = {pattern.partition("/")[0] for pattern in ALLOWED_FILE_GLOBS if "/" in pattern}
ALLOWED_FOLDERS = ALLOWED_TOP_FOLDERS | {f"report/{name}" for name in ("series", "tables", "figures")}
ALLOWED_FOLDERS |= {"series/kept", "exports/mcap"}


def is_allowed_top_name(name: str) -> bool:
    """Whether a run folder can contain a folder or file of this name, which is not a path."""
    return name in ALLOWED_TOP_FOLDERS or any(
        fnmatchcase(name, pattern) for pattern in ALLOWED_FILE_GLOBS if "/" not in pattern
    )
