"""Phrases of a library are checked when they are read."""

from pathlib import Path

import pytest

from mutator.config.phrases_yaml import ChangePhraseModel, PhraseModel, SignedPhraseModel, build_phrase
from mutator.config.yaml_source_lines import YamlSource
from mutator.errors import MutatorError

SOURCE = YamlSource(path=Path("spec.yaml"), data={}, lines={(): 1, ("phrase",): 4, ("phrase", "lower"): 6})


@pytest.mark.parametrize(
    ("model", "texts_by_case"),
    [
        (None, {}),
        ("reads {value}", {"": ("reads {value}",)}),
        (["reads {value}", "reads"], {"": ("reads {value}", "reads")}),
        (SignedPhraseModel(positive="up", negative=["down"]), {"positive": ("up",), "negative": ("down",)}),
        (ChangePhraseModel(higher="more", lower="less"), {"higher": ("more",), "lower": ("less",)}),
    ],
)
def test_a_phrase_is_its_texts_by_case(
    model: PhraseModel | SignedPhraseModel | ChangePhraseModel | None,
    texts_by_case: dict[str, tuple[str, ...]],
) -> None:
    """A text, a list and a phrase by sign or direction have one form."""
    assert build_phrase(model, ("value",), SOURCE, ("phrase",)) == texts_by_case


@pytest.mark.parametrize(
    ("model", "message"),
    [
        ("reads {speed}", r"spec.yaml:4: hole '\{speed\}'; expected \{value\}, \{abs_value\}"),
        ("reads {}", r"spec.yaml:4: hole '\{\}'"),
        ("reads { value", r"spec.yaml:4: a single brace in 'reads \{ value'"),
        ("  ", r"spec.yaml:4: an empty phrase"),
        ([], r"spec.yaml:4: an empty phrase"),
        (ChangePhraseModel(higher="more", lower="{gas}"), r"spec.yaml:6: hole '\{gas\}'"),
    ],
)
def test_a_wrong_phrase_is_an_error_with_its_line(
    model: PhraseModel | ChangePhraseModel, message: str
) -> None:
    """The error names the hole and those that exist."""
    with pytest.raises(MutatorError, match=message):
        build_phrase(model, ("value", "abs_value"), SOURCE, ("phrase",))
