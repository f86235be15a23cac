"""What a user chose for a plan, beside the campaign file."""

from dataclasses import dataclass

from mutator._common.argument_checks import check_type, check_whole_number
from mutator._common.hashing import added_field
from mutator.errors import MutatorError
from mutator.store.shards import Shard


@dataclass(frozen=True, slots=True, kw_only=True)
class Choices:
    """Options that override the campaign file; None: as in the file.

    Filters (`mutator.campaigns.row_filters`) use the columns that are known before an experiment runs.
    """

    seed: int | None = None  #: the seed of the sample, of drawn values and of random triggers
    reading: str | None = None  #: the reading of the fault specs
    only: str | None = None  #: filter: keep the experiments that match
    exclude: str | None = None  #: filter: drop the experiments that match
    limit: int | None = None  #: how many experiments to keep; each variant equally often, for a quick look
    shard: str | None = None  #: the shard to run, `k/n`
    series_mb: int | None = None  #: the budget of the series in MiB; 0: no series
    #: with `limit`: keep each fault type in each scenario in proportion to its size, in pairs
    proportional: bool = added_field(False)

    def __post_init__(self) -> None:
        for name, least in (("seed", 0), ("limit", 1), ("series_mb", 0)):
            if (value := getattr(self, name)) is not None:
                check_whole_number(name, value, least=least)
        for name in ("reading", "only", "exclude", "shard"):
            if (value := getattr(self, name)) is not None:
                check_type(name, value, str, "text")
        check_type("proportional", self.proportional, bool, "True or False")
        if self.proportional and self.limit is None:
            raise MutatorError(
                "without a limit",
                argument="proportional",
                expected="the number of experiments to keep, together with `proportional`",
                remedy="add `limit`, or leave out `proportional`",
            )
        if self.shard is not None:
            Shard.parse(self.shard)
