"""What random runs say of a probability."""

from __future__ import annotations

#: Confidence of the Clopper-Pearson interval.
CONFIDENCE = 0.95


def clopper_pearson(good: int, count: int) -> dict[str, float]:
    """Exact confidence interval of a success probability (Clopper and Pearson 1934)."""
    from scipy.stats import beta

    tail = (1 - CONFIDENCE) / 2
    low = 0.0 if good == 0 else float(beta.ppf(tail, good, count - good + 1))
    high = 1.0 if good == count else float(beta.ppf(1 - tail, good + 1, count - good))
    return {"lower": low, "upper": high, "confidence": CONFIDENCE}
