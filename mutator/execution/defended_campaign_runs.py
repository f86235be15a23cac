"""A campaign with a set of defences in a user's pytest session: its items, and its run folder."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from mutator.campaigns.defended_runs import defended_run_path, open_or_freeze_defended_run
from mutator.defences.defence_facts import set_name
from mutator.execution.campaign_items import key_of_set
from mutator.execution.campaign_runs import CampaignRun
from mutator.execution.listed_items import ItemListing, ListedItem
from mutator.execution.session_summary import Summary
from mutator.results.hazards_caused_by_defences import caused_golden_hazards_note
from mutator.store.run_folder import RunFolder


class DefendedCampaignRun(CampaignRun):
    """The experiments of a campaign with one of its sets of defences. Its folder is in that of the run
    without defences, which begins first.
    """

    must_reach_hazard = False  # no hazard with defences is a result

    def __init__(
        self, undefended: CampaignRun, names: tuple[str, ...], *arguments: Any, **keywords: Any
    ) -> None:
        super().__init__(undefended.path, *arguments, **keywords)
        self._undefended, self._names = undefended, names
        self.title = f"{undefended.title} with {set_name(names)}"

    def _list_items(self) -> ItemListing:
        listing = self._undefended.listing
        return replace(listing, items=tuple(map(self._item, listing.items)))

    def _item(self, item: ListedItem) -> ListedItem:
        name = key_of_set(set_name(self._names), item.name)
        return replace(item, name=name, markers=(*item.markers, *self._names))

    def result_lines(self, summary: Summary) -> Sequence[str]:
        """Return the hazards that the defences cause without a fault."""
        if self.out is None or self._undefended.out is None:
            return ()
        undefended, defended = (RunFolder.open(path) for path in (self._undefended.out, self.out))
        return [caused_golden_hazards_note(undefended, defended)]

    def _default_run_folder(self) -> Path:
        self._undefended.begin()
        assert self._undefended.out is not None
        return defended_run_path(self._undefended.out, self._names)

    def _open_folder(self, out: Path) -> RunFolder:
        undefended = RunFolder.open(out.parents[1])
        return open_or_freeze_defended_run(self._workspace, undefended, self._names)
