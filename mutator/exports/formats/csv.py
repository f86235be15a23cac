"""Write a table of a run as CSV."""

from mutator.exports import Export, ExportRequest, ExportTable
from mutator.results.table_reader import Results


def _content(request: ExportRequest) -> bytes:
    results = Results.up_to_date(request.folder.path)
    if request.parts.table is ExportTable.RESULTS:
        return results.csv()
    frame = results.timings() if request.parts.table is ExportTable.TIMINGS else results.propagation()
    return frame.to_csv(index=False, lineterminator="\n").encode()


EXPORT = Export(about="a table as CSV", file="{table}.csv", write=_content, options=frozenset({"table"}))
