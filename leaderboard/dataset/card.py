"""The card of a data set: ``README.md`` in its folder, for people."""

from __future__ import annotations

from collections.abc import Mapping

from simnav.leaderboard.results.citation import citation
from simnav.leaderboard.results.provenance import here
from simnav.scenario import Scenario

from .manifest import FILE, Manifest, SplitReport
from .parts import PART
from .schemas import schemas
from .splits import FIRST_SEEDS, TEST

__all__ = ["card"]

#: What the rows of a table are.
_TABLES = {
    "voyages": "one row a voyage: its seed, length, datasheets, and the initial state with its covariance that an "
    "estimator receives; in splits with truth also the faults, the values that were drawn, the true datasheets where "
    "those of the estimator are wrong, and the true initial state",
    "imu": "the samples of the IMU: means over the interval that ends at the time, body axes forward, starboard, down",
    "aids": "the readings of all other instruments, each in the order of its time stamps. `value` has the components "
    "of its kind. `arrival_s` is null where a reading arrives at its time",
    "truth": "the true states at the ends of the steps",
    "missing": "the readings that are missing because of an outage or a lost bottom lock",
}


def card(family: Scenario, manifest: Manifest, splits: Mapping[str, SplitReport]) -> str:
    """The text of ``README.md``."""
    made, cited = here(), citation()
    lines = [
        f"# {family.title}",
        "",
        f"Recordings of random voyages of the family `{manifest.family}`, simulated by simnav for estimators that "
        "learn.",
        "",
        " ".join(family.description.split()),
        "",
        "| split | voyages | hours | MB | seeds from |",
        "|---|---|---|---|---|",
        *(
            f"| {name} | {split.voyages} | {split.duration / 3600.0:.1f} | {split.size / 1e6:.1f} | "
            f"{'a secret key' if name == TEST else FIRST_SEEDS[name]} |"
            for name, split in splits.items()
        ),
        "",
        "## How the voyages were drawn",
        "",
        "Each voyage has a seed, and all random numbers follow from it: the values of the family's distributions "
        "(`draws`), the sea, the errors and the faults. No voyage of the board, of another split, or of the training "
        "of simnav's own estimators has the same random numbers.",
        "",
        f"Split `{TEST}` has neither truth nor labels. simnav scores it: `simnav score {family.name} ESTIMATES.csv "
        "--seed SEED --sealed KEYFILE`, with the seed of the voyage."
        + (f" Its seeds follow from a key, of which {manifest.sealed} is the hash." if manifest.sealed else ""),
        "",
        f"An estimator that learned from a split says so: `learned_from` in `{FILE}` is the value of its attribute "
        "of that name. simnav then refuses to score it on these voyages.",
        "",
        "## Files",
        "",
        f"`SPLIT/PART/TABLE.parquet`, with {PART} voyages a part. The i-th row group of each file is the i-th voyage "
        "of the part. SI units and radians; names of columns end in their unit. Lists of `voyages` are position "
        "(latitude, longitude, height), velocity (north, east, down), attitude (roll, pitch, yaw), and a covariance "
        "by rows.",
        "",
        "| table | rows |",
        "|---|---|",
        *(f"| `{name}` | {text} |" for name, text in _TABLES.items()),
        "",
        "| table | columns | of these in splits with truth only |",
        "|---|---|---|",
        *(_columns(name) for name in _TABLES),
        "",
        "`faults` is a bit mask: bit j is fault j of the voyage. `fault_error` is what the faults added, and `sigma` "
        "is the true noise. Samples of the IMU are rounded to a step below a 32nd of the noise that the datasheet "
        "declares. They, velocities and angles of the truth, and labels are in single precision. JSON texts may "
        "contain `Infinity`.",
        "",
        "In Python, `simnav.read_voyages(FOLDER, SPLIT)` gives the recordings.",
        "",
        "## Versions",
        "",
        f"simnav {made.simnav}{f', commit {made.commit}' if made.commit else ''}"
        f"{' with changes' if made.dirty else ''}; {made.benchmark}; simulator {manifest.simulator}; files "
        f"{manifest.format}; NumPy {made.numpy}, Numba {made.numba}. Written on {made.date}.",
        "",
        "## Licence",
        "",
        f"MIT, as simnav. To be cited: {cited.text}",
    ]
    return "\n".join(lines) + "\n"


def _columns(table: str) -> str:
    """A line of the table of columns."""
    told = schemas(True)[table].names
    plain = schemas(False)[table].names if table in schemas(False) else []
    more = [name for name in told if name not in plain]
    return f"| `{table}` | {_listed(plain)} | {_listed(more)} |"


def _listed(names: list[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)
