"""Pictures of the envelopes of two runs over each other."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mutator.comparison.envelope_changes import EnvelopeChange
from mutator.explore.envelope_texts import name_of_plane
from mutator.figures.plane_drawing import draw_two_planes

if TYPE_CHECKING:
    from markupsafe import Markup


@dataclass(frozen=True, slots=True, kw_only=True)
class EnvelopePicture:
    """A plane: its name, what changed, and its drawing; `evidence_id` is a run that shows why it is smaller,
    empty if it is not.
    """

    name: str
    text: str
    drawing: "Markup"
    evidence_id: str = ""


def draw_envelope_changes(changes: Sequence[EnvelopeChange]) -> Iterator[EnvelopePicture]:
    """Yield a picture for each plane with the same lattice in both runs, those that got smaller first."""
    from markupsafe import Markup

    def order(change: EnvelopeChange) -> tuple[bool, int]:
        return not change.is_smaller, -(change.became_hazardous + change.became_undecided)

    for change in sorted(changes, key=order):
        a, b = change.a, change.b
        if (a.magnitudes, a.durations_s) == (b.magnitudes, b.durations_s):
            name, text = name_of_plane(b), change.text.removeprefix(f"{name_of_plane(b)}: ")
            yield EnvelopePicture(
                name=name,
                text=f"{text}.",
                drawing=Markup(draw_two_planes(a, b, change.text)),
                evidence_id=change.evidence.experiment_id if change.evidence else "",
            )
