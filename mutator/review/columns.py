"""The columns for filters over groups. They are in a separate module because help texts need only them."""

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
