"""Print what is survived."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from mutator.cli.terminal_output import Terminal

if TYPE_CHECKING:
    from mutator.explore.envelope import Envelope


def print_envelopes(terminal: Terminal, envelopes: "Sequence[Envelope]") -> None:
    """Print a sentence and a row for each envelope."""
    from mutator.explore.envelope_texts import (
        describe_challenges,
        describe_envelope,
        describe_validation,
        envelope_table,
    )

    for envelope in envelopes:
        terminal.print_text(f"{describe_envelope(envelope)} ({describe_validation(envelope)})")
        for sentence in describe_challenges(envelope):
            terminal.print_text(f"  {sentence}")
    table = envelope_table(envelopes)
    terminal.print_text()
    terminal.print_table(table.heads, table.rows, right_aligned=list(table.right_aligned))
