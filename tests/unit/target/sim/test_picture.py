"""Images that compute their pixels when they are read."""

from copy import deepcopy

import numpy as np
import pytest
from selfdrive.sim.picture import Picture, Region, whole

WHOLE = np.arange(6 * 8, dtype=np.uint8).reshape(6, 8)


def picture(asked=None):
    """Return an image that computes only the requested part. `asked` records the requests."""

    def make(region):
        if asked is not None:
            asked.append(region)
        return WHOLE[region.part]

    return Picture(("some",), WHOLE.shape, make)


CUTS = [
    np.s_[1:3, 2:5],
    np.s_[:, :4],
    np.s_[2:, :],
    np.s_[-3:5, 1:2],
    np.s_[1:-1, :3],
    np.s_[:20, 1:30],
    np.s_[::2, ::3],
    np.s_[5:1:-1, :2],
    np.s_[4:2, :3],
    np.s_[:0, :3],
    np.s_[3],
    np.s_[2, 5],
    np.s_[1:3],
    np.s_[..., 0],
    np.s_[[1, 2], [3, 4]],
]


@pytest.mark.parametrize("cut", CUTS)
def test_a_slice_equals_the_slice_of_an_array(cut):
    one = picture()
    assert np.array_equal(one[cut], WHOLE[cut])
    one.pixels()
    assert np.array_equal(one[cut], WHOLE[cut])


def test_only_the_requested_pixels_are_computed():
    asked = []
    one = picture(asked)
    assert (one.shape, one.dtype, len(one)) == ((6, 8), np.uint8, 6) and asked == []
    _ = one[1:3, 2:5]
    assert asked == [Region(1, 3, 2, 5)]
    np.asarray(one), one.pixels(), one[1:3, 2:5], one.mean()
    assert asked == [Region(1, 3, 2, 5), whole((6, 8))]


def test_an_image_can_be_used_like_an_array():
    one = picture()
    assert np.array_equal(one * 0.5 + 3, WHOLE * 0.5 + 3) and np.array_equal(200 - one, 200 - WHOLE)
    assert np.array_equal(one.astype(float), WHOLE.astype(float)) and (one == WHOLE).all()
    assert one.mean() == WHOLE.mean() and np.array_equal(np.flip(one, 1), WHOLE[:, ::-1])
    assert np.array_equal(deepcopy(one), WHOLE)


def add_in_place(one):
    one += 5


def add_into(one):
    np.add(one, 1, out=one)


def put(one):
    one[...] = 1


def put_into_cut(one):
    one[1:3, 2:5][:] = 1


def put_into_pixels(one):
    one.pixels()[0, 0] = 1


@pytest.mark.parametrize("made", [False, True])
@pytest.mark.parametrize("write", [add_in_place, add_into, put, put_into_cut, put_into_pixels])
def test_an_image_is_read_only(write, made):
    """The pixels and slices of an image are read-only, too, because all runs share the frame."""
    one = picture()
    if made:
        one.pixels()
    with pytest.raises(ValueError, match="read-only"):
        write(one)
    assert np.array_equal(one, np.arange(48).reshape(6, 8))


def test_results_of_arithmetic_can_be_written_to():
    one = picture()
    more = one + 5
    more += one
    more[0, 0] = 9
    assert type(more) is np.ndarray and np.array_equal(more[1:], 2 * WHOLE[1:] + 5) and more[0, 0] == 9
