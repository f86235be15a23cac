"""A run written for other tools: mutation testing viewers, CI servers, spreadsheets, data frames.

What people look at in a browser is in `report`, never here.
"""

from enum import StrEnum


class Format(StrEnum):
    """What a run can be written as."""

    MUTATION_ELEMENTS = "mutation-elements"  #: JSON that viewers of mutation reports read
    JUNIT = "junit"  #: JUnit XML, as CI servers read it
    CSV = "csv"  #: a table as CSV
    PARQUET = "parquet"  #: a table as Parquet
    MCAP = "mcap"  #: a folder of traces, one MCAP file per experiment


class Table(StrEnum):
    """The tables of a run folder."""

    RESULTS = "results"
    PROPAGATION = "propagation"
    TIMINGS = "timings"
