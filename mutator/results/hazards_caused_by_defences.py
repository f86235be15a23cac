"""The hazards that defences cause without any fault."""

from mutator.store.checks_file import HazardTimes, describe_golden_hazards
from mutator.store.run_folder import RunFolder


def caused_golden_hazards(undefended: RunFolder, defended: RunFolder) -> dict[str, HazardTimes]:
    """Return the hazards that golden runs have with defences only, by the keys of these runs."""
    hazards_by_key = {
        key: tuple(h for h in hazards if h[0] not in golden_hazard_names(undefended, key))
        for key, hazards in sorted(defended.golden_hazards.items())
    }
    return {key: hazards for key, hazards in hazards_by_key.items() if hazards}


def caused_golden_hazards_note(undefended: RunFolder, defended: RunFolder) -> str:
    """Return a line on the golden runs in which the defences cause a hazard; '' if there is none."""
    hazards_by_key = caused_golden_hazards(undefended, defended)
    if not hazards_by_key:
        return ""
    goldens = (f"{key} ({describe_golden_hazards(h)})" for key, h in hazards_by_key.items())
    return f"with {defended.path.name}, a hazard without any fault, by a defence: {', '.join(goldens)}"


def golden_hazard_names(run: RunFolder, key: str) -> tuple[str, ...]:
    """Return the hazards of a golden run."""
    return tuple(name for name, _ in run.golden_hazards.get(key, ()))
