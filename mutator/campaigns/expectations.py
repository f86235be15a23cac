"""What the results of a campaign may be, for those who let a test fail on others."""

from dataclasses import dataclass, field

from mutator._common.yaml_dataclasses import pydantic_mapping_config, yaml_metadata
from mutator.model import Record
from mutator.outcomes.verdict_rules import classified_hazard_of
from mutator.targets.hazard_severity import SeverityScale


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """The hazards that are allowed. Under pytest, an experiment with another one is a test that fails."""

    __pydantic_config__ = pydantic_mapping_config("Expected results")

    hazards: list[str] | None = field(
        default=None,
        metadata=yaml_metadata(
            "The hazards that experiments may reach, by name; `[]`: none. Without it, all, up to `severity`."
        ),
    )
    severity: str | None = field(
        default=None,
        metadata=yaml_metadata(
            "The worst class of severity that is allowed. A hazard without a class is then not allowed. "
            "Default: all classes."
        ),
    )

    def problem_with(self, record: Record, scale: SeverityScale | None) -> str:
        """Return what a record has that is not allowed; empty if all is."""
        others = [name for name, _ in record.hazards if self.hazards is not None and name not in self.hazards]
        if others:
            allowed = ", ".join(self.hazards or ()) or "none"
            return f"hazard {', '.join(dict.fromkeys(others))}, allowed: {allowed}"
        if self.severity is None or not record.hazards:
            return ""
        worst = classified_hazard_of(record, scale)
        if worst is None:
            return (
                f"hazard {record.hazards[0][0]} without a class of severity, allowed: up to {self.severity}"
            )
        if worst.severity > self.severity:
            return f"hazard {worst.hazard} of severity {worst.severity}, allowed: up to {self.severity}"
        return ""


NO_HAZARD = Expectation(hazards=[])
