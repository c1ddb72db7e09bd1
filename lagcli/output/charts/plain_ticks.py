"""Ticks of an axis as plain numbers, without a library for figures."""

from __future__ import annotations

import math

STEPS = (1.0, 2.0, 2.5, 5.0, 10.0)  # between ticks, times a power of ten


def ticks(low: float, high: float, most: int) -> list[tuple[float, str]]:
    """About `most` round values from low to high, each with a text that tells it from the next."""
    rough = (high / most) - (low / most)
    if not (rough > 0 and math.isfinite(rough)):
        return [(low, f"{low:.6g}")] if math.isfinite(low) else []
    power = 10.0 ** math.floor(math.log10(rough))
    step = next((part * power for part in STEPS if part * power >= rough * (1 - 1e-9)), 10 * power)
    if step <= 0.0 or high / step - math.floor(low / step) > 100 * most:
        return [(low, f"{low:.6g}"), (high, f"{high:.6g}")]
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    values = [number * step for number in range(first, last + 1)]
    largest = max(map(abs, values), default=0.0)
    digits = max(1, math.ceil(math.log10(largest / step) + 1e-9) + 2) if largest else 1
    texts = [f"{value:.{digits}g}" for value in values]
    if not any("e" in text for text in texts):
        decimals = max(len(text.partition(".")[2]) for text in texts)
        texts = [f"{value:.{decimals}f}" for value in values]
    return [
        (value, text.replace("e-0", "e-").replace("e+0", "e"))
        for value, text in zip(values, texts, strict=True)
    ]
