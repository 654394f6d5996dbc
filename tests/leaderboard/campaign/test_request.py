"""How an estimator is asked for."""

from __future__ import annotations

import pytest

from simnav.leaderboard.campaign.request import split_estimators


def test_estimators_are_split_with_their_parameters():
    assert split_estimators(["a:x=1,y=2,b", "c.py:C:z=(1)"]) == [
        ("a", {"x": "1", "y": "2"}),
        ("b", {}),
        ("c.py:C", {"z": "(1)"}),
    ]
    with pytest.raises(ValueError, match="parameters follow a name"):
        split_estimators(["a,x=1"])
