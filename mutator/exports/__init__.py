"""Write runs for other tools: mutation testing viewers, CI servers, spreadsheets, data frames."""

from enum import StrEnum


class Format(StrEnum):
    """The formats that a run can be written in."""

    MUTATION_ELEMENTS = "mutation-elements"  #: JSON for viewers of mutation reports
    JUNIT = "junit"  #: JUnit XML for CI servers
    CSV = "csv"  #: a table as CSV
    PARQUET = "parquet"  #: a table as Parquet
    MCAP = "mcap"  #: a folder of traces, one MCAP file per experiment


class Table(StrEnum):
    """The tables that can be exported."""

    RESULTS = "results"
    PROPAGATION = "propagation"
    TIMINGS = "timings"
