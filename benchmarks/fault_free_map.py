"""Draw a map of drives without faults: `python benchmarks/fault_free_map.py RUN OUT.png`.

RUN is the run folder of a campaign without faults, such as `fault_free`. Each family has a square of its
first two parameters with several values. A point is a drive, coloured by its smallest time to collision,
a cross one that ended in a hazard.
"""

import argparse
import math
from pathlib import Path

import matplotlib.pyplot as plt
import pandas as pd

import mutator

METRIC = "smallest_ttc"  # s
MOST_S = 6.0  # of the colours: what is larger is far from any edge
COLUMNS = 4


def axes_of(drives: pd.DataFrame, keys: list[str]) -> list[str]:
    """Return the first two parameters with numbers of which the drives have several values."""
    varied = [key for key in keys if pd.to_numeric(drives[key], errors="coerce").nunique() > 1]
    return [*varied, "driven_s"][:2]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("out", type=Path)
    options = parser.parse_args()
    run = mutator.load_run(options.run)
    drives = run.drives()
    columns = list(drives.columns)
    keys = columns[columns.index("scenario") + 1 : columns.index("driven_s")]
    hazards = [column for column in columns if column.startswith("t_")]
    families = [
        (name, group) for name, group in drives.groupby("scenario") if group[keys].notna().any().any()
    ]
    rows = math.ceil(len(families) / COLUMNS)
    figure, squares = plt.subplots(
        rows, COLUMNS, figsize=(3.0 * COLUMNS, 2.9 * rows), squeeze=False, layout="constrained"
    )
    points = None
    for square, (name, group) in zip(squares.flat, families, strict=False):
        first, second = axes_of(group, keys)
        ended = group[hazards].notna().any(axis=1)
        safe = group[~ended]
        points = square.scatter(
            safe[first],
            safe[second],
            c=safe[METRIC].fillna(MOST_S),
            cmap="viridis",
            vmin=0.0,
            vmax=MOST_S,
            s=12,
        )
        square.scatter(group[first][ended], group[second][ended], marker="x", color="crimson", s=18)
        square.set(title=f"{name}: {len(group)}", xlabel=first, ylabel=second)
    for square in squares.flat[len(families) :]:
        square.axis("off")
    if points is not None:
        figure.colorbar(points, ax=squares, label=f"{METRIC} [s]", shrink=0.6)
    figure.savefig(options.out, dpi=75)


if __name__ == "__main__":
    main()
