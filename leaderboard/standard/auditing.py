"""An audit of results that ship: a random sample of them is repeated with the code of today.

Declared versions say which results should be what the code of today gives. The audit tests it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from simnav.leaderboard.campaign.verification import Verification, verify_results
from simnav.leaderboard.results.errors import RequestError

__all__ = ["CONFIDENCE", "SAMPLE", "Audit", "audit", "share_found"]

#: Results that are repeated, by default.
SAMPLE = 20
#: Probability with which a sample finds at least one wrong result.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Audit:
    """What came of repeating a sample of results.

    Attributes
    ----------
    verification : Verification
        What was repeated, and what differs.
    share : float
        Share of wrong results from which on a sample of this size finds one or more, with probability `CONFIDENCE`.
    """

    verification: Verification
    share: float

    @property
    def passed(self) -> bool:
        """Whether something was repeated, and all of it gave the stored scores."""
        return self.verification.passed

    def to_dict(self) -> dict[str, Any]:
        """What ``simnav standard audit --json`` prints."""
        return {**asdict(self.verification), "share": self.share, "confidence": CONFIDENCE, "passed": self.passed}

    def sentence(self) -> str:
        """What the size of the sample means."""
        return (
            f"if {self.share:.1%} of the results or more were wrong, such a sample would find one with a probability "
            f"of {CONFIDENCE:.0%}"
        )


def share_found(repeated: int, confidence: float = CONFIDENCE) -> float:
    """Share of wrong results that a random sample finds with a probability.

    A sample of n results contains none of the wrong ones with probability (1 - share)^n.

    >>> round(share_found(20), 3), round(share_found(300), 3), share_found(0)
    (0.139, 0.01, 1.0)
    """
    return 1.0 - (1.0 - confidence) ** (1.0 / repeated) if repeated else 1.0


def audit(folder: Path, sample: int = SAMPLE, progress: Callable[..., None] | None = None) -> Audit:
    """Repeat a random sample of results; see `simnav.leaderboard.publishing.audit_standard`."""
    if sample < 1:
        raise RequestError(f"sample = {sample}: at least one result has to be repeated")
    found = verify_results(folder, sample=sample, progress=progress)
    return Audit(found, share_found(found.repeated - len(found.not_repeatable) - len(found.not_here)))
