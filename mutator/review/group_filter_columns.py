"""The columns for filters over groups. Help texts import them without the rest of the package."""

GROUP_FILTER_COLUMNS = (
    "group",
    "state",
    "by",
    "reason",
    "flagged",
    "file",
    "function",
    "model",
    "trigger",
    "hold",
    "spec",
    "faults",
    "runs",
)
