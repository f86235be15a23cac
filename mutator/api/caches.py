"""What can be deleted: the caches on this machine, on which no result depends, and run folders."""

from mutator._common.cache_layout_and_pruning import caches_folder as cache_folder
from mutator._common.cache_layout_and_pruning import clear_cache as clear_caches
from mutator._common.cache_layout_and_pruning import list_entries as cache_entries
from mutator._common.cache_layout_and_pruning import prune_cache as prune_caches
from mutator.store.run_deletion import delete_run as delete_run_folder
from mutator.store.run_deletion import list_deletable_files as check_run_folder

__all__ = [
    "cache_entries",
    "cache_folder",
    "check_run_folder",
    "clear_caches",
    "delete_run_folder",
    "prune_caches",
]
