"""A comparison as text."""

from math import isfinite

from selfdrive.sim.compare import key_figures
from selfdrive.sim.compare.trace_comparison import ChannelComparison, KeyFigureComparison, TraceComparison

_MIN_SHOWN_DIFFERENCE = 5e-5  # smaller differences are rounded to 0 and have no time

_TABLE_HEAD = f"  {'channel':<16}{'unit':<6}{'rms':>10}{'largest':>11}{'at [s]':>9}{'lag [s]':>9}  limits"


def comparison_lines(comparison: TraceComparison, *, all_channels: bool) -> list[str]:
    """Key figures and limited channels; `all_channels` adds the other channels and all crossings."""
    verdict = "within tolerance" if comparison.is_within_tolerance else "BEYOND TOLERANCE"
    out = [f"{comparison.name}: {verdict}"]
    out += [f"  {key_figure_line(result)}" for result in comparison.figure_comparisons]
    out.append(_TABLE_HEAD)
    for result in comparison.channel_comparisons:
        if all_channels or result.limits.listing_threshold is not None or result.limits.lag_s is not None:
            out.append(_channel_line(result))
            out += _crossing_lines(result) if all_channels else ()
    return out


def key_figure_line(result: KeyFigureComparison) -> str:
    run_text, reference_text = (
        key_figures.figure_text(result.name, result.run_value),
        key_figures.figure_text(result.name, result.reference_value),
    )
    limit = "" if result.limit is None else f", limit {result.limit:g}"
    difference = f"{result.difference:.3f}" if isfinite(result.difference) else "not comparable"
    flag = "  <-- beyond" if result.is_beyond_limit else ""
    values = f"{run_text:>12}   reference {reference_text:>12}   difference {difference}"
    return f"{result.name:<15} {values}{limit}{flag}"


def _channel_line(result: ChannelComparison) -> str:
    limits = [
        f"{name} {value:g}"
        for name, value in (
            ("rms", result.limits.rms),
            ("max", result.limits.max),
            ("lag", result.limits.lag_s),
        )
        if value is not None
    ]
    lag = "-" if result.lag_s is None else f"{result.lag_s:+.2f}"
    is_shown = abs(result.peak_difference) >= _MIN_SHOWN_DIFFERENCE
    largest, at = (
        (f"{result.peak_difference:+.4f}", f"{result.peak_at_s:.2f}") if is_shown else ("0.0000", "-")
    )
    flag = f"  <-- {', '.join(result.exceeded_limits)} beyond" if result.exceeded_limits else ""
    return (
        f"  {result.column.channel:<16}{result.column.unit:<6}{result.rms:>10.4f}{largest:>11}"
        f"{at:>9}{lag:>9}  {', '.join(limits) or '-'}{flag}"
    )


def _crossing_lines(result: ChannelComparison) -> list[str]:
    return [
        f"    beyond {result.limits.listing_threshold:g}"
        f" from {crossing.begin_s:.2f} to {crossing.end_s:.2f} s,"
        f" most at {crossing.largest_at_s:.2f} s: {crossing.largest_difference:+.4f}"
        for crossing in result.crossings
    ]
