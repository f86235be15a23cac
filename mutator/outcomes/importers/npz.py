"""Read traces from .npz files, with an array for each channel."""

import io

import numpy as np

from mutator._common.bounded_reading import read_bounded
from mutator.errors import BadTrace
from mutator.outcomes import npz_reader
from mutator.outcomes.trace_files import (
    MOST_COLUMNS,
    MOST_TRACE_BYTES,
    Arrays,
    Importer,
    TraceRequest,
    by_channel,
    check_trace_size,
)


def _read_columns(request: TraceRequest) -> Arrays:
    data = read_bounded(request.path, MOST_TRACE_BYTES)
    members = npz_reader.read_members(data)
    if members is not None:
        return {name: members[name] for name in request.choose_names(members)}
    if data.startswith(npz_reader.ARRAY_MAGIC):
        raise BadTrace("a single array", "an .npz file")
    if data.count(npz_reader.ENTRY_MAGIC) > MOST_COLUMNS:
        raise BadTrace(f"{data.count(npz_reader.ENTRY_MAGIC)} members", f"at most {MOST_COLUMNS}")
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        check_trace_size(sum(member.file_size for member in file.zip.infolist()))
        return {name: np.asarray(file[name]) for name in request.choose_names(file.files)}


def _read_npz(request: TraceRequest) -> Arrays:
    return by_channel(_read_columns(request), request)


IMPORTER = Importer(about="an array for each channel (NumPy)", read=_read_npz)
