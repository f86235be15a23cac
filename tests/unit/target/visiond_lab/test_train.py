"""Training with the same seed gives the same windows and the same net."""

import numpy as np
import pytest
from selfdrive.visiond.lane_net import PAPER_NET, LaneNet
from selfdrive.visiond_lab import train
from selfdrive.visiond_lab.training_windows import MOST_WINDOWS_PER_LABEL, draw_labelled_windows


@pytest.fixture(scope="module")
def sample() -> tuple[np.ndarray, np.ndarray]:
    return draw_labelled_windows(2, np.random.default_rng(99))


def test_windows_are_balanced_and_reproducible(sample):
    features, labels = sample
    assert 0.4 < labels.mean() < 0.6
    assert len(labels) <= 2 * 6 * 2 * MOST_WINDOWS_PER_LABEL
    again = draw_labelled_windows(1, np.random.default_rng(99))
    number = len(again[1])
    assert np.array_equal(again[0], features[:number])
    assert np.array_equal(again[1], labels[:number])


def test_the_shipped_net_recognises_marks_on_unseen_roads(sample):
    """The roads are deliberately hard."""
    features, labels = sample
    assert np.mean((LaneNet.load(PAPER_NET).log_odds(features) > 0.0) == labels) >= 0.75


def test_weights_can_be_stored_and_loaded(tmp_path):
    net = LaneNet.load(PAPER_NET)
    net.save(tmp_path / "a.npz")
    LaneNet.load(tmp_path / "a.npz").save(tmp_path / "b.npz")
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


@pytest.mark.slow
def test_training_is_reproducible_and_agrees_with_the_shipped_net(tmp_path, sample, capsys):
    for name in ("a.npz", "b.npz"):
        assert train.main(["--small", "--out", str(tmp_path / name)]) == 0
    assert "are classified correctly" in capsys.readouterr().out
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    small, shipped = (
        net.log_odds(sample[0]) > 0.0 for net in (LaneNet.load(tmp_path / "a.npz"), LaneNet.load(PAPER_NET))
    )
    assert np.mean(small == shipped) >= 0.65
