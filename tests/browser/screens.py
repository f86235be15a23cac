"""The screens on which pages are looked at."""

import pytest

# each width and each scheme in the ordinary suite, all pairs in the slow one
on_each_screen = pytest.mark.parametrize(
    ("width", "scheme"),
    [
        (1440, "light"),
        (400, "dark"),
        pytest.param(1440, "dark", marks=pytest.mark.slow),
        pytest.param(400, "light", marks=pytest.mark.slow),
    ],
)
