"""What filters over groups of mutants may ask; a module of its own, since help texts need nothing else."""

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
