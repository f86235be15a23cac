"""A comparison as text."""

from math import isfinite

from selfdrive.sim.compare import key_figures
from selfdrive.sim.compare.trace_comparison import ChannelResult, Comparison, FigureResult

_SMALLEST = 5e-5  # smaller differences are rounded to 0 and have no time

_HEAD = f"  {'channel':<16}{'unit':<6}{'rms':>10}{'largest':>11}{'at [s]':>9}{'lag [s]':>9}  limits"


def lines(comparison: Comparison, *, long: bool) -> list[str]:
    """Key figures and limited channels; `long` adds all other channels and all crossings."""
    verdict = "within tolerance" if comparison.good else "BEYOND TOLERANCE"
    out = [f"{comparison.name}: {verdict}"]
    out += [f"  {figure_line(result)}" for result in comparison.figures]
    out.append(_HEAD)
    for result in comparison.channels:
        if long or result.limits.band is not None or result.limits.lag is not None:
            out.append(_channel_line(result))
            out += _crossing_lines(result) if long else ()
    return out


def figure_line(result: FigureResult) -> str:
    ours, theirs = key_figures.text(result.name, result.ours), key_figures.text(result.name, result.reference)
    limit = "" if result.limit is None else f", limit {result.limit:g}"
    apart = f"{result.difference:.3f}" if isfinite(result.difference) else "not comparable"
    flag = "  <-- beyond" if result.failed else ""
    return f"{result.name:<15} {ours:>12}   reference {theirs:>12}   difference {apart}{limit}{flag}"


def _channel_line(result: ChannelResult) -> str:
    limits = [
        f"{name} {value:g}"
        for name, value in (
            ("rms", result.limits.rms),
            ("max", result.limits.max),
            ("lag", result.limits.lag),
        )
        if value is not None
    ]
    lag = "-" if result.lag is None else f"{result.lag:+.2f}"
    seen = abs(result.largest) >= _SMALLEST
    largest, at = (f"{result.largest:+.4f}", f"{result.at:.2f}") if seen else ("0.0000", "-")
    flag = f"  <-- {', '.join(result.failures)} beyond" if result.failures else ""
    return (
        f"  {result.column.channel:<16}{result.column.unit:<6}{result.rms:>10.4f}{largest:>11}"
        f"{at:>9}{lag:>9}  {', '.join(limits) or '-'}{flag}"
    )


def _crossing_lines(result: ChannelResult) -> list[str]:
    return [
        f"    beyond {result.limits.band:g} from {one.begin:.2f} to {one.end:.2f} s,"
        f" most at {one.at:.2f} s: {one.worst:+.4f}"
        for one in result.crossings
    ]
