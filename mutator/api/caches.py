"""The caches on this machine; results never depend on them."""

from mutator._common.caches import clear as clear_caches
from mutator._common.caches import entries as cache_entries
from mutator._common.caches import folder as cache_folder
from mutator._common.caches import prune as prune_caches

__all__ = ["cache_entries", "cache_folder", "clear_caches", "prune_caches"]
