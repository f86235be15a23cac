"""Read traces from .csv files, with a column for each channel."""

import io

from mutator._common.bounded_reading import read_bounded
from mutator.errors import BadTrace
from mutator.outcomes.trace_files import (
    MOST_COLUMNS,
    Arrays,
    Importer,
    TraceRequest,
    by_channel,
    frame_columns,
)

MOST_CSV_BYTES = 64_000_000  # bytes; as numbers, text takes more memory


def _read_csv(request: TraceRequest) -> Arrays:
    import pandas as pd

    data = read_bounded(request.path, MOST_CSV_BYTES)
    # without the end of a line, the file is one line
    commas = data.count(b",", 0, data.find(b"\n") + 1 or None)
    if commas >= MOST_COLUMNS:
        raise BadTrace(f"{commas + 1} columns", f"at most {MOST_COLUMNS}")
    columns = frame_columns(pd.read_csv(io.BytesIO(data)), request)
    return by_channel(columns, request, has_empty_cells=True)


IMPORTER = Importer(about="a column for each channel", read=_read_csv)
