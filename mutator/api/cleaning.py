"""Delete run folders for `mutator clean`, each one completely or not at all."""

from mutator.store.cleaning import check
from mutator.store.cleaning import clean as delete

__all__ = ["check", "delete"]
