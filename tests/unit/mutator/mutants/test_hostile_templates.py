"""No template takes long or needs much memory, whatever its author intends."""

from pathlib import Path

import pytest

from mutator.faults.fault_models import SnippetKind
from mutator.mutants.restricted_template_language import MOST_TEMPLATE_OR_RESULT_CHARACTERS
from mutator.mutants.template_rendering import render_snippet, render_template
from tests.costs import is_cheap, is_refused
from tests.unit.mutator.mutants.test_template_rendering import model

SOURCE = "distances(" + ", ".join(f"a{i}" for i in range(2000)) + ")"
NAMES = {"fi": "ab12", "by": 2.0, "n": 10**9, "target": "x", "original": SOURCE, "arguments": ["a"] * 2000}
HOSTILE = {
    "a long text": "{{ 'a' * 10**9 }}",
    "a long text without a power": "{{ 'a' * 1000000000 }}",
    "a long list": "{{ ([1] * 1000000000) | length }}",
    "a list times a parameter": "{{ (arguments * n) | length }}",
    "a power": "{{ 9 ** 9 ** 9 }}",
    "powers of a parameter": "{{ by ** by ** n ** n }}",
    "a large number": "{{ " + "9" * 5000 + " }}",
    "squares of a large number": "{% set x = " + "9" * 4000 + " %}" + "{% set x = x * x %}" * 60 + "{{ x }}",
    "a factorial": "{% set x = 10 ** 100 %}{{ x }}",
    "a format": "{{ '%0999999999d' % 1 }}",
    "a format filter": "{{ '%0999999999d' | format(1) }}",
    "a format method": "{{ '{:999999999}'.format(1) }}",
    "a format map": "{{ '{a:999999999}'.format_map(x) }}",
    "center": "{{ 'a' | center(1000000000) }}",
    "center method": "{{ 'a'.center(1000000000) }}",
    "ljust": "{{ 'a'.ljust(1000000000) }}",
    "zfill": "{{ 'a'.zfill(1000000000) }}",
    "expandtabs": "{{ '\\t'.expandtabs(1000000000) }}",
    "indent": "{{ 'a\\nb' | indent(1000000000) }}",
    "replace": "{{ original | replace('', original) | replace('', original) }}",
    "replace method": "{{ original.replace('', original).replace('', original) }}",
    "translate": "{{ original.translate({97: original}) }}",
    "join method": "{{ original.join(original) }}",
    "join of joins": "{% set x = arguments | join(original) %}{{ arguments | join(x) }}",
    "wordwrap": "{{ original | wordwrap(1, wrapstring=original) }}",
    "urlize": "{{ (original + ' http://') | urlize }}",
    "xmlattr": "{{ {'a': original} | xmlattr }}",
    "tojson": "{{ arguments | tojson(1000000000) }}",
    "pprint": "{{ arguments | pprint }}",
    "batch": "{{ 'a' | batch(1000000000, 'x') | list }}",
    "slice": "{{ 'a' | slice(1000000000) | list }}",
    "sum": "{{ arguments | map('length') | sum }}",
    "round": "{{ 5 | round(-1000000000) }}",
    "truncate": "{{ original | truncate(1, end=original) }}",
    "range": "{{ range(1000000000) | length }}",
    "a range in a loop": "{% for i in range(1000000000) %}{% endfor %}",
    "loops in loops": "{% for a in arguments %}{% for b in arguments %}{% for c in arguments %}"
    "{% endfor %}{% endfor %}{% endfor %}",
    "a loop over a text": "{% for a in original %}{% for b in original %}{{ b }}{% endfor %}{% endfor %}",
    "a recursive loop": "{% for a in arguments recursive %}{{ loop(arguments) }}{% endfor %}",
    "a loop that writes": "{% for a in arguments %}{{ original }}{% endfor %}",
    "a loop of long text": "{% for a in arguments %}" + "y" * 20_000 + "{% endfor %}",
    "loops that do nothing": "{% for a in arguments %}" + "{% if a %}{% endif %}" * 400 + "{% endfor %}",
    "a doubled text": "{% set x = original %}" + "{% set x = x + x %}" * 40 + "{{ x }}",
    "a concatenated text": "{% set x = original %}" + "{% set x = x ~ x %}" * 40 + "{{ x }}",
    "a doubled list": "{% set x = arguments %}" + "{% set x = x + x %}" * 40 + "{{ x | length }}",
    "nested lists": "{% set x = [1] %}" + "{% set x = [x, x] %}" * 60 + "{{ x | string }}",
    "nested tuples": "{% set x = (1,) %}" + "{% set x = (x, x) %}" * 60 + "{{ x }}",
    "nested dictionaries": "{% set x = {} %}" + "{% set x = {1: x, 2: x} %}" * 60 + "{{ x | tojson }}",
    "a block set": "{% set x %}yy{% endset %}" + "{% set x %}{{ x }}{{ x }}{% endset %}" * 40 + "{{ x }}",
    "a filter block": "{% filter center(1000000000) %}a{% endfilter %}",
    "a macro that calls itself": "{% macro m() %}{{ m() }}{{ m() }}{% endmacro %}{{ m() }}",
    "a caller": "{% macro m() %}{{ caller() }}{{ caller() }}{% endmacro %}{% call m() %}{% endcall %}",
    "an include": "{% include 't.py.j2' %}",
    "an import": "{% import '/etc/passwd' as x %}",
    "an extends": "{% extends 't.py.j2' %}",
    "a block": "{% block b %}{{ self.b() }}{{ self.b() }}{% endblock %}",
    "a namespace": "{% set n = namespace(x=original) %}{% for a in arguments %}{% set n.x = n.x + n.x %}"
    "{% endfor %}",
    "a cycler": "{{ cycler(1, 2).next() }}",
    "a joiner": "{{ joiner(original)() }}",
    "lorem ipsum": "{{ lipsum(1000000) }}",
    "a dict": "{{ dict(a=original) }}",
    "splits": "{% for a in arguments %}" + "{% set x = original.split('a') %}" * 200 + "{% endfor %}",
    "deep brackets": "{{ " + "(" * 20_000 + "1" + ")" * 20_000 + " }}",
    "deep lists": "{{ " + "[" * 20_000 + "]" * 20_000 + " }}",
    "many signs": "{{ " + "-" * 20_000 + "1 }}",
    "many nots": "{{ " + "not " * 20_000 + "1 }}",
    "a long sum": "{{ 1" + "+1" * 20_000 + " }}",
    "a long comparison": "{{ 1" + "<1" * 20_000 + " }}",
    "many filters": "{{ by" + "|abs" * 20_000 + " }}",
    "many attributes": "{{ by" + ".a" * 20_000 + " }}",
    "texts in texts": "{% for a in arguments %}{% if original[1:] in original %}{% endif %}{% endfor %}",
    "equal texts": "{% for a in arguments %}{% if original == original %}{% endif %}{% endfor %}",
    "later texts": "{% for a in arguments %}{% if 1 < 2 < original %}{% endif %}{% endfor %}",
    "slices of texts": "{% for a in arguments %}{% set x = original[::-1] %}{% endfor %}",
    "slices of lists": "{% for a in arguments %}{% set x = arguments[::-1] %}{% endfor %}",
    "equal lists": "{% for a in arguments %}{% if arguments == arguments %}{% endif %}{% endfor %}",
    "the test `in`": "{% for a in arguments %}{% if 'b' is in arguments %}{% endif %}{% endfor %}",
    "a filtered loop": "{% for a in arguments if 'b' in arguments %}{% endfor %}",
    "many conditions": "{% if by %}" * 5000 + "{% endif %}" * 5000,
    "many branches": "{% if by %}" + "{% elif by %}" * 5000 + "{% endif %}",
    "many outputs": "{{ by }}" * 5_000,
    "a long template": "y" * (MOST_TEMPLATE_OR_RESULT_CHARACTERS + 1),
    "open brackets": "{{" * 20_000,
    "open tags": "{%" * 20_000,
    "dots": "{{ " + "1." * 20_000 + " }}",
    "an attribute of the interpreter": "{{ ''.__class__.__mro__[1].__subclasses__() }}",
    "stars": "{{ refuse(*arguments) }}",
}  # fmt: skip
WRITTEN = {  # by a valid template, for Python's parser
    "deep brackets": "(" * 20_000 + "x" + ")" * 20_000,
    "deep lists": "[" * 20_000 + "]" * 20_000,
    "signs": "-" * 40_000 + "x",
    "nots": "not " * 10_000 + "x",
    "a sum": "x" + "+x" * 20_000,
    "a power": "x" + "**x" * 20_000,
    "a chain of calls": "x" + "()" * 20_000,
    "a chain of attributes": "x" + ".x" * 20_000,
    "lambdas": "lambda: " * 5_000 + "x",
    "a choice": "x if x else " * 8000 + "x",
    "a large number": "9" * 20_000,
    "an f-string": "f'" + "{x}" * 15_000 + "'",
    "a long list": "[" + "x," * 20_000 + "]",
    "a null character": "x\0",
    "a surrogate": "'\ud800'",
}


@pytest.mark.parametrize("template", HOSTILE.values(), ids=HOSTILE)
def test_a_hostile_template_is_soon_refused(template: str) -> None:
    assert is_refused(lambda: render_template(template, NAMES, Path("t.py.j2"))).startswith("t.py.j2")


@pytest.mark.parametrize("text", WRITTEN.values(), ids=WRITTEN)
def test_code_that_a_template_writes_is_soon_checked(text: str) -> None:
    target = {"target": "x", "by": 1.0}
    is_cheap(lambda: render_snippet(model(f"x = {text}\n", SnippetKind.INSERT), target, "ab12"))
    is_cheap(lambda: render_snippet(model(f"if {text}:\n", SnippetKind.GUARD), target, "ab12"))
    is_cheap(lambda: render_snippet(model(text, SnippetKind.VALUE), target, "ab12"))
