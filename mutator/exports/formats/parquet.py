"""Write a table of a run as Parquet."""

from mutator.exports import Export, ExportRequest, ExportTable
from mutator.results.table_reader import Results


def _content(request: ExportRequest) -> bytes:
    results = Results.up_to_date(request.folder.path)
    if request.parts.table is ExportTable.RESULTS:
        return results.parquet()
    is_timings = request.parts.table is ExportTable.TIMINGS
    return results.timings_parquet() if is_timings else results.propagation_parquet()


EXPORT = Export(
    about="a table as Parquet", file="{table}.parquet", write=_content, options=frozenset({"table"})
)
