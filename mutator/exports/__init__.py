"""A run written for other tools: mutation testing viewers, CI servers, spreadsheets, data frames.

What people look at in a browser is in `report`, never here.
"""

from enum import StrEnum


class Format(StrEnum):
    """What a run can be written as."""

    MUTATION_ELEMENTS = "mutation-elements"
    JUNIT = "junit"
    CSV = "csv"
    PARQUET = "parquet"
    MCAP = "mcap"


class Table(StrEnum):
    """The tables of a run folder."""

    RESULTS = "results"
    PROPAGATION = "propagation"
    TIMINGS = "timings"
