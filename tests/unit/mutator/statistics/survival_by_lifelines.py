"""The results of lifelines for ten samples of censored times. Run this file by hand:

    python -m venv /tmp/lifelines && /tmp/lifelines/bin/pip install lifelines==0.30.3
    /tmp/lifelines/bin/python survival_by_lifelines.py > survival_by_lifelines.json

Lifelines is not a dependency of the tests, because it needs an older pandas than theirs.
"""

import json
import random

import lifelines
from lifelines import KaplanMeierFitter
from lifelines.utils import median_survival_times

Sample = list[tuple[float, int]]  # times; 1 is an event, 0 is censored


def events(*times: float) -> Sample:
    return [(time, 1) for time in times]


def censored(*times: float) -> Sample:
    return [(time, 0) for time in times]


def drawn(seed: int, size: int, mean: float, until: float, digits: int) -> Sample:
    """Exponential times, censored at uniform times, with few digits, so that there are ties."""
    draw = random.Random(seed)
    pairs = [(draw.expovariate(1 / mean), draw.uniform(0.1, until)) for _ in range(size)]
    return [(max(round(min(t, end), digits), 10**-digits), int(t <= end)) for t, end in pairs]


SAMPLES: dict[str, Sample] = {
    # Freireich et al., Blood 21 (1963), as in Cox and Oakes, Analysis of Survival Data (1984), table 1.1
    "6-MP": events(6, 6, 6, 7, 10, 13, 16, 22, 23) + censored(6, 9, 10, 11, 17, 19, 20, 25, 32, 32, 34, 35),
    "placebo": events(1, 1, 2, 2, 3, 4, 4, 5, 5, 8, 8, 8, 8, 11, 11, 12, 12, 15, 17, 22, 23),
    # Miller, Survival Analysis (1981): the data set `aml` of R's survival
    "maintained": events(9, 13, 18, 23, 31, 34, 48) + censored(13, 28, 45, 161),
    "not maintained": events(5, 5, 8, 8, 12, 23, 27, 30, 33, 43, 45) + censored(16),
    "flat at one half": events(0.4, 1.01, 1.32, 2.0),
    "flat at one half, censored": events(1, 1, 2, 3) + censored(1.25, 1.5, 1.75, 4),
    "one half to the end": events(1, 2) + censored(3, 3),
    "never one half": events(1, 2, 2, 3) + censored(*(5 + i / 10 for i in range(20))),
    "ties": drawn(1, 100, mean=4.0, until=12.0, digits=0),
    "large": drawn(2, 200, mean=3.0, until=8.0, digits=6),
}


def told(sample: Sample) -> dict[str, object]:
    times, status = zip(*sorted(sample), strict=True)
    fitter = KaplanMeierFitter().fit(times, status)
    at = sorted({time for time, event in sample if event})
    band = fitter.confidence_interval_
    low, high = median_survival_times(band).to_numpy()[0]
    return {
        "times": times,
        "status": status,
        "at": at,
        "survival": fitter.survival_function_at_times(at).tolist(),
        "low": band.iloc[:, 0].loc[at].tolist(),
        "high": band.iloc[:, 1].loc[at].tolist(),
        "median": fitter.median_survival_time_,
        "median_low": low,
        "median_high": high,
    }


if __name__ == "__main__":
    told_of = {name: told(sample) for name, sample in SAMPLES.items()}
    print(json.dumps({"lifelines": lifelines.__version__, "samples": told_of}))
