"""Envelopes with their curve as a frame and as a figure."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator.explore.envelope import Envelope
from mutator.explore.exploration_replay import ExplorationReplay
from mutator.figures.envelope_figure import draw_envelope

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class RunEnvelope(Envelope):
    """What faults of one kind do in one scenario from one start on, by magnitude and duration."""

    @property
    def curve(self) -> "pd.DataFrame":
        """A row for each magnitude: the longest duration up to which all are survived, the shortest
        hazardous one, and the time to hazard of the longest one that was driven to a hazard, in s.
        """
        import pandas as pd

        lines = range(len(self.magnitudes))
        return pd.DataFrame(
            {
                "magnitude": pd.Series(self.magnitudes, dtype=float),
                "longest_survived_s": pd.Series(map(self.longest_survived_s, lines), dtype=float),
                "shortest_hazardous_s": pd.Series(map(self.shortest_hazardous_s, lines), dtype=float),
                "time_to_hazard_s": pd.Series(map(self.time_to_hazard_s, lines), dtype=float),
            }
        )

    def plot(self) -> "Figure":
        """Plot the cells over duration and magnitude: runs as marks, what follows from them shaded, what is
        not decided in gray.
        """
        return draw_envelope(self)


def envelopes_of_replay(replay: ExplorationReplay) -> tuple[RunEnvelope, ...]:
    """Return the envelopes of a replayed exploration."""
    return tuple(RunEnvelope(envelope.exploration) for envelope in replay.envelopes)
