"""Write a table of a run as Parquet."""

from mutator.exports import Export, ExportRequest, ExportTable
from mutator.results.table_reader import Results


def _table_parquet(request: ExportRequest) -> bytes:
    results = Results.up_to_date(request.folder.path)
    if request.selection.table is ExportTable.RESULTS:
        return results.parquet()
    is_timings = request.selection.table is ExportTable.TIMINGS
    return results.timings_parquet() if is_timings else results.propagation_parquet()


EXPORT = Export(
    about="a table as Parquet", file="{table}.parquet", write=_table_parquet, options=frozenset({"table"})
)
