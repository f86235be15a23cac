"""The columns for filters over groups, in a separate module because help texts need nothing else."""

COLUMNS = (
    "group",
    "state",
    "by",
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
