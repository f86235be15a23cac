"""Part the probe's two templates: settings, which differ between mutants, and code, which does not.

A probe is one file in which parts of the two alternate. Lines of each template mark where the parts of the
other go. The parts are rendered separately, so that the code is rendered and compiled once for all mutants.
"""

from dataclasses import dataclass
from itertools import accumulate
from pathlib import Path

from mutator.config.location_syntax import PROBE_MODULE_NAME
from mutator.errors import MutatorError

CODE_TEMPLATE_FILE = f"{PROBE_MODULE_NAME}.py.j2"
SETTINGS_TEMPLATE_FILE = f"{PROBE_MODULE_NAME}_settings.py.j2"
PROBE_TEMPLATE_FILES = (CODE_TEMPLATE_FILE, SETTINGS_TEMPLATE_FILE)
_SETTINGS_MARK, _CODE_MARK = "{# settings #}\n", "{# code #}\n"


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
    def from_texts(cls, folder: Path, code_text: str, settings_text: str) -> "ProbeTemplates":
        """Make the parts of the texts of `PROBE_TEMPLATE_FILES`; MutatorError if their marks do not fit."""
        before, *code = _split_template_at_marks(folder / CODE_TEMPLATE_FILE, code_text, _SETTINGS_MARK)
        settings = _split_template_at_marks(folder / SETTINGS_TEMPLATE_FILE, settings_text, _CODE_MARK)
        if before.text or len(code) != len(settings):
            raise MutatorError(
                f"{len(settings)} parts of settings",
                where=folder / SETTINGS_TEMPLATE_FILE,
                expected=f"{len(code)}, one for each `{_SETTINGS_MARK.strip()}` in {CODE_TEMPLATE_FILE}, "
                "its first line",
                remedy=f"correct the lines `{_SETTINGS_MARK.strip()}` there and `{_CODE_MARK.strip()}` here",
            )
        return cls(settings=tuple(settings), code=tuple(code))

    @property
    def whole_text(self) -> str:
        """The template of the whole probe. Ids of mutants, and reviews, are bound to this text."""
        return "".join(
            settings_part.text + code_part.text
            for settings_part, code_part in zip(self.settings, self.code, strict=True)
        )


def _split_template_at_marks(path: Path, text: str, mark: str) -> list[TemplatePart]:
    texts = text.split(mark)
    lines = accumulate((part.count("\n") + 1 for part in texts[:-1]), initial=1)
    return [
        TemplatePart(text=part_text, path=path, line=line)
        for part_text, line in zip(texts, lines, strict=True)
    ]
