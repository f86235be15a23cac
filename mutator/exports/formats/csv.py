"""Write a table of a run as CSV."""

from mutator.exports import Export, ExportRequest, ExportTable
from mutator.results.table_reader import Results


def _table_csv(request: ExportRequest) -> bytes:
    results = Results.up_to_date(request.folder.path)
    if request.selection.table is ExportTable.RESULTS:
        return results.csv()
    frame = results.timings() if request.selection.table is ExportTable.TIMINGS else results.propagation()
    return frame.to_csv(index=False, lineterminator="\n").encode()


EXPORT = Export(about="a table as CSV", file="{table}.csv", write=_table_csv, options=frozenset({"table"}))
