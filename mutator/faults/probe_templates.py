"""The probe's two templates: settings, which differ between mutants, and code, which does not.

A probe is one file in which parts of the two alternate. Lines of each template mark where the parts of the
other go. The parts are rendered separately, so that the code is rendered and compiled once for all mutants.
"""

from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

from mutator.config.location_syntax import PROBE_NAME
from mutator.errors import MutatorError

CODE = f"{PROBE_NAME}.py.j2"
SETTINGS = f"{PROBE_NAME}_settings.py.j2"
FILES = (CODE, SETTINGS)
_SETTINGS_HERE, _CODE_HERE = "{# settings #}\n", "{# code #}\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class TemplatePart:
    """A part of the template at `path`, which begins in line `line` (from 1)."""

    text: str
    path: Path
    line: int


@dataclass(frozen=True, slots=True, kw_only=True)
class ProbeTemplates:
    """The parts of the two templates. In a probe, each part of `settings` precedes its part of `code`."""

    settings: tuple[TemplatePart, ...]
    code: tuple[TemplatePart, ...]

    @classmethod
    def of(cls, folder: Path, code_text: str, settings_text: str) -> "ProbeTemplates":
        """Make the parts of the texts of `FILES`; MutatorError if their marks do not fit."""
        before, *code = _parts(folder / CODE, code_text, _SETTINGS_HERE)
        settings = _parts(folder / SETTINGS, settings_text, _CODE_HERE)
        if before.text or len(code) != len(settings):
            raise MutatorError(
                f"{len(settings)} parts of settings",
                where=folder / SETTINGS,
                expected=f"{len(code)}, one for each `{_SETTINGS_HERE.strip()}` in {CODE}, its first line",
                remedy=f"correct the lines `{_SETTINGS_HERE.strip()}` there and `{_CODE_HERE.strip()}` here",
            )
        return cls(settings=tuple(settings), code=tuple(code))

    @property
    def text(self) -> str:
        """The template of the whole probe. Ids of mutants, and reviews, are bound to this text."""
        return "".join(one.text + other.text for one, other in zip(self.settings, self.code, strict=True))


def _parts(path: Path, text: str, mark: str) -> list[TemplatePart]:
    texts = text.split(mark)
    lines = accumulate((one.count("\n") + 1 for one in texts[:-1]), initial=1)
    return [TemplatePart(text=one, path=path, line=line) for one, line in zip(texts, lines, strict=True)]
