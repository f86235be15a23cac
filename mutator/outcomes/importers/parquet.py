"""Read traces from .parquet files, with a column for each channel."""

import io

from mutator._common.bounded_reading import read_bounded
from mutator.errors import BadTrace
from mutator.outcomes.trace_files import (
    MOST_TRACE_BYTES,
    Arrays,
    Importer,
    TraceRequest,
    by_channel,
    check_trace_size,
    frame_columns,
)

_NUMERIC_TYPES = ("BOOLEAN", "INT32", "INT64", "FLOAT", "DOUBLE")


def _read_parquet(request: TraceRequest) -> Arrays:
    import pandas as pd
    from pyarrow import parquet  # type: ignore[import-untyped]

    data = read_bounded(request.path, MOST_TRACE_BYTES)
    # reading ahead starts threads of pyarrow, and one of them could abort the process at its exit
    file = parquet.ParquetFile(io.BytesIO(data), pre_buffer=False)
    names = list(request.choose_names(file.schema_arrow.names))
    check_trace_size(file.metadata.num_rows * min(len(names), file.metadata.num_columns) * 8)
    for column in file.schema:
        if column.name in names and column.physical_type not in _NUMERIC_TYPES:
            raise BadTrace(f"channel {column.name} is not numeric", "a number in each row")
    columns = frame_columns(pd.read_parquet(io.BytesIO(data), columns=names), request)
    return by_channel(columns, request, has_empty_cells=True)


IMPORTER = Importer(about="a column for each channel", read=_read_parquet)
