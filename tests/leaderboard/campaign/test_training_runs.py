"""No estimator is scored on a run that its parameters were learned from, whoever it is of."""

from __future__ import annotations

import json
import pickle
import sys
from pathlib import Path

import pytest

from simnav.environment.seeds import FIRST_TRAINING_SEED, training_seed
from simnav.estimator import make
from simnav.leaderboard.campaign.campaign import run_campaign
from simnav.leaderboard.campaign.confinement.estimator_process import _Session
from simnav.leaderboard.campaign.entrant import Entrant
from simnav.leaderboard.campaign.request import EstimatorRequest
from simnav.leaderboard.campaign.training_runs import declared_ranges, ranges_of, record_of, require_unseen
from simnav.leaderboard.results import store
from simnav.leaderboard.results.errors import RequestError
from simnav.scenario import load

LEARNED = """
from simnav import Estimate, Estimator

class Learned(Estimator):
    learned_from = {ranges}

    def reset(self, start, instruments):
        self._position = start.position

    def update(self, measurements):
        return Estimate(measurements.time, position=self._position)
"""


def entrant(*ranges: tuple[int, int]) -> Entrant:
    return Entrant("mine", {}, "mine", False, "", learned_from=ranges)


@pytest.mark.parametrize("seeds", [range(5), [4, 2, 0], range(0, 5, 2), range(2**40 - 1)])
def test_seeds_beside_those_of_the_training_are_scored(seeds: range) -> None:
    both = [load("gnss-noise-step"), load("training-gnss-faults")]
    require_unseen([entrant((5 + 2**40, 9 + 2**40), (2**63 + 2**40, 2**63 + 2**40 + 5))], both, seeds)
    require_unseen([entrant()], both, range(2**62))


@pytest.mark.parametrize("seeds", [range(3, 9), [9, 7], range(1, 20, 3), range(2**62)])
def test_a_run_that_was_learned_from_is_refused(seeds: range) -> None:
    with pytest.raises(RequestError, match=r"'mine' has learned from .* seed \d+ of gnss-noise-step-v1"):
        require_unseen([entrant((100, 200), (6, 8))], [load("gnss-noise-step")], seeds)


def test_a_training_family_has_random_streams_of_its_own() -> None:
    """Seed 7 of a training family shares no random stream with seed 7 of a board's scenario."""
    family = load("training-gnss-faults")
    learned = entrant((family.root(7), family.root(7)))
    require_unseen([learned], [load("gnss-noise-step")], [7])
    with pytest.raises(RequestError, match=f"seed 7 of {family.id}"):
        require_unseen([learned], [family], [7])


def test_the_policy_that_comes_along_is_not_scored_on_its_training_voyages(tmp_path: Path) -> None:
    policy = EstimatorRequest("policy-ekf")
    family = load("training-gnss-faults")
    assert ranges_of(declared_ranges(make("policy-ekf")))[0][0] == family.root(training_seed(0))
    with pytest.raises(RequestError, match=f"'policy-ekf' has learned from .* seed {FIRST_TRAINING_SEED} of"):
        run_campaign([family], [policy], [3, FIRST_TRAINING_SEED], tmp_path / "out", workers=1)


@pytest.mark.usefixtures("clean_registry")
@pytest.mark.parametrize(
    ("ranges", "message"),
    [("[(3, 5)]", "'learned' has learned from .* seed 3 of"), ("7", "learned_from should hold at most 1000 pairs")],
)
def test_an_estimator_of_others_tells_it_too(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ranges: str, message: str
) -> None:
    (tmp_path / "learned.py").write_text(LEARNED.format(ranges=ranges))
    mine = EstimatorRequest(str(tmp_path / "learned.py"))
    with pytest.raises(RequestError, match=message):
        run_campaign([load("gnss-noise-step")], [mine], range(4), tmp_path / "out", workers=1, confinement="none")
    session = _Session()
    monkeypatch.setattr(sys, "path", list(sys.path))
    name = f"{tmp_path / 'learned.py'}"
    reply = session.describe(pickle.dumps((Entrant(name, {}, "learned", False, ""), sys.path, [0])))
    told = json.loads(reply[reply.index(b"{") :])
    assert told["learned_from"] == ([[3, 5]] if ranges.startswith("[") else "TypeError: 'int' object is not iterable")


@pytest.mark.parametrize("told", [None, "text", [[1]], [[1, 2.5]], [[True, 2]], [[1, 2]] * 1001])
def test_what_is_no_pairs_of_integers_is_refused(told: object) -> None:
    with pytest.raises(ValueError, match="learned_from should hold at most 1000 pairs of integers"):
        ranges_of(told)


def test_results_say_what_a_row_learned_from(tmp_path: Path) -> None:
    """Of the policy that comes along, and of a file of others that learned."""
    told = "[(3, 5)]\n    trained_on = {'scenario': 'bay', 'voyages': 3}"
    (tmp_path / "taught.py").write_text(LEARNED.format(ranges=told).replace("Learned", "Taught"))
    scenario = load("gnss-noise-step").model_copy(update={"duration": 20.0})
    asked = [EstimatorRequest("policy-ekf"), EstimatorRequest(str(tmp_path / "taught.py")), EstimatorRequest("ekf")]
    run_campaign([scenario], asked, [7], tmp_path / "out", workers=1, confinement="none")
    learned = {r.estimator: r.learned for r in store.load(tmp_path / "out")}
    assert learned["policy-ekf"]["trained_on"]["voyages"] == 64
    assert learned["policy-ekf"]["learned_from"] == [list(pair) for pair in make("policy-ekf").learned_from]
    assert learned["taught"] == {"learned_from": [[3, 5]], "trained_on": {"scenario": "bay", "voyages": 3}}
    assert learned["ekf"] == {}


def test_a_record_of_a_training_is_short_and_plain() -> None:
    assert record_of([[1, 2]]) == {"learned_from": [[1, 2]]}
    assert record_of({"learned_from": [], "trained_on": {"voyages": 2}}) == {"trained_on": {"voyages": 2}}
    for record in ({"a": "x" * 9000}, [1], "text"):
        with pytest.raises(ValueError, match="trained_on should be a table of at most 8000 characters"):
            record_of({"learned_from": [], "trained_on": record})
