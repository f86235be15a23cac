"""Phrases of a library: short texts with holes, such as `the speed sensor reads {abs_value} too low`, from
which the sentence about an experiment is put together.
"""

from collections.abc import Collection, Mapping

from pydantic import Field

from mutator._common.phrase_texts import PhraseTexts, has_single_brace, holes_of
from mutator.config.yaml_files import StrictModel
from mutator.config.yaml_source_lines import KeyPath, YamlSource

PhraseByCase = Mapping[str, PhraseTexts]  # `positive` and `negative`, `higher` and `lower`; '' for all cases
PhraseModel = str | list[str]


class SignedPhraseModel(StrictModel, title="A phrase with a sign"):
    """A phrase for values from 0 on, and one for values below 0."""

    positive: PhraseModel = Field(description="The phrase if the drawn value is 0 or more.")
    negative: PhraseModel = Field(description="The phrase if the drawn value is less than 0.")


class ChangePhraseModel(StrictModel, title="A phrase with a direction"):
    """What the car does if the actuator leaves golden in this direction."""

    higher: PhraseModel = Field(description="The phrase if it is first higher than in the golden run.")
    lower: PhraseModel = Field(description="The phrase if it is first lower than in the golden run.")


def build_phrase(
    model: PhraseModel | SignedPhraseModel | ChangePhraseModel | None,
    holes: Collection[str] | None,
    source: YamlSource,
    keys: KeyPath,
) -> PhraseByCase:
    """Return the texts by case; {} without a phrase. MutatorError, with the line, for an empty phrase and for
    a hole that is not in `holes` (None: `check_holes` checks them later).
    """
    if model is None:
        return {}
    if isinstance(model, SignedPhraseModel | ChangePhraseModel):
        phrase = {case: _texts_of(getattr(model, case)) for case in type(model).model_fields}
    else:
        phrase = {"": _texts_of(model)}
    for case, texts in phrase.items():
        if not texts or not all(text.strip() for text in texts):
            raise source.error(
                _case_keys(keys, case), "an empty phrase", expected="a text", remedy="leave out `phrase`"
            )
    if holes is not None:
        check_holes(phrase, holes, source, keys)
    return phrase


def _texts_of(model: PhraseModel) -> PhraseTexts:
    return (model,) if isinstance(model, str) else tuple(model)


def _case_keys(keys: KeyPath, case: str) -> KeyPath:
    return (*keys, case) if case else keys


def check_holes(phrase: PhraseByCase, holes: Collection[str], source: YamlSource, keys: KeyPath) -> None:
    """Raise MutatorError, with the line, for a hole that is not in `holes`, and for a single brace."""
    allowed = ", ".join(f"{{{name}}}" for name in holes) or "no hole"
    for case, texts in phrase.items():
        for text in texts:
            unknown = [name for name in holes_of(text) if name not in holes]
            if unknown or has_single_brace(text):
                got = f"hole '{{{unknown[0]}}}'" if unknown else f"a single brace in '{text}'"
                raise source.error(
                    _case_keys(keys, case), got, expected=allowed, remedy="correct or remove the hole"
                )
