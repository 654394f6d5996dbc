"""Inertial measurement units by name and by grade, with the figures of their manufacturers.

The figures are entered in the units of the datasheets. Three rules lead from a datasheet to the error model of
`simnav.sensors.imu`:

- Limits (plus or minus) are taken as three sigma, other figures as one sigma.
- Bias instability is a level of the Allan deviation: its lowest point, or that point divided by 0.664 (the coefficient
  of flicker noise, IEEE Std 952-1997, annex C). The in-run bias of simnav is a first-order Gauss-Markov process, whose
  Allan deviation has its maximum at 0.6173 of its standard deviation. The standard deviation is chosen so that this
  maximum is the level that the datasheet states.
- No datasheet states a correlation time. It is set to 300 s for MEMS and to 3600 s for optical gyroscopes.

The turn-on bias is what differs from one start to the next. A limit that also covers the life of a unit and all
temperatures is not a turn-on bias: a user calibrates most of it once. Such limits are named in `ImuModel.read_in`, and
are not used.

Every model has a turn-on bias and a run-to-run error of the scale factor. Where the datasheet is silent, those of its
grade are assumed (`ASSUMED`, with sources), and `ImuModel.assumed` names them. Anything else that a datasheet does not
state is zero (noise) or without limit (ranges). `ImuModel.read_in` says where the figures were read, because not every
datasheet is public. The revision of the datasheet is given where the reading says it. A unit whose figures only one
project quotes, without a revision, is not listed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from simnav.spec import SpecError, closest

__all__ = ["ASSUMED", "GRADES", "IMU_MODELS", "MARKOV_PEAK", "Assumption", "Grade", "ImuModel", "imu_model"]

#: Largest Allan deviation of a first-order Gauss-Markov process over its standard deviation, at 1.89 correlation times:
#: IEEE Std 952-1997, annex C, eq. C.12 (0.437 q sqrt(T) with q = sigma sqrt(2 / T)).
MARKOV_PEAK = 0.6173
#: Lowest Allan deviation of flicker noise over its coefficient: sqrt(2 ln 2 / pi).
_FLICKER = 0.664
_MEMS, _OPTICAL = 300.0, 3600.0
#: Figures that may be assumed; one that begins like another one comes first.
_FIELDS = ("bias_instability", "bias", "random_walk", "scale")

Grade = Literal["mems", "industrial", "tactical", "intermediate", "navigation"]


@dataclass(frozen=True)
class Assumption:
    """Figures that are assumed of the IMUs of a grade, where a datasheet is silent.

    Attributes
    ----------
    gyroscope, accelerometer : mapping
        Figures by their keys, as in `ImuModel`.
    source : str
        Where they come from.
    """

    gyroscope: Mapping[str, float]
    accelerometer: Mapping[str, float]
    source: str


#: What is assumed of each grade. HG9900, the only model of navigation grade, states all of it.
ASSUMED: Mapping[Grade, Assumption] = {
    "mems": Assumption(
        gyroscope={"bias_deg_h": 600.0, "scale_ppm": 3000.0},
        accelerometer={"bias_mg": 10.0, "scale_ppm": 3000.0},
        source="Gyroscopes: turn-on to turn-on within 0.5 deg/s (Xsens, 'Bias repeatability of gyroscopes'), taken as "
        "three sigma; 0.1 deg/s in N. El-Sheimy and A. Youssef, Satellite Navigation 1:2, 2020, table 1. "
        "Accelerometers: geometric middle of more than 3 mg (Groves 2013, table 4.1, consumer grade) and the 30 mg of "
        "the Crista IMU (S. Godha, UCGE Report 20239, 2006). Scale: geometric middle of the 1000 ppm of calibrated "
        "sensors (Groves 2013, section 4.4.2) and the 10 000 ppm of the Crista IMU",
    ),
    "industrial": Assumption(
        gyroscope={"bias_deg_h": 60.0, "scale_ppm": 1000.0},
        accelerometer={"bias_mg": 3.0, "scale_ppm": 1000.0},
        source="Bias of gyroscopes: ten times the in-run bias of 6 deg/h, because the bias that changes in a run is a "
        "tenth of the constant one (Groves 2013, section 4.4.1). Bias of accelerometers: middle of 1 to 10 mg (Groves "
        "2013, table 4.1). Scale: upper end of 100 to 1000 ppm (Groves 2013, section 4.4.2)",
    ),
    "tactical": Assumption(
        gyroscope={"bias_deg_h": 1.0, "scale_ppm": 300.0},
        accelerometer={"bias_mg": 1.0, "scale_ppm": 300.0},
        source="Bias: lower end of 1 to 10 deg/h and 1 to 5 mg (N. El-Sheimy and A. Youssef, Satellite Navigation 1:2, "
        "2020, table 1), and of 1 to 100 deg/h and 1 to 10 mg (Groves 2013, table 4.1). Scale: middle of 100 to 1000 "
        "ppm (Groves 2013, section 4.4.2)",
    ),
    "intermediate": Assumption(
        gyroscope={
            "bias_deg_h": 0.1,
            "random_walk_deg_sqrt_h": 0.01,
            "bias_instability_deg_h": 0.01,
            "scale_ppm": 100.0,
        },
        accelerometer={
            "bias_mg": 0.32,
            "random_walk_ug_sqrt_hz": 50.0,
            "bias_instability_ug": 32.0,
            "scale_ppm": 100.0,
        },
        source="Bias: 0.1 deg/h and the middle of 0.1 to 1 mg (Groves 2013, table 4.1); in a run a tenth of it "
        "(section 4.4.1). Scale: lower end of 100 to 1000 ppm (section 4.4.2). Random walks: between those of "
        "aviation and of tactical grade (section 4.4.3)",
    ),
}  # fmt: skip


@dataclass(frozen=True)
class ImuModel:
    """An IMU of a manufacturer, or a class of IMUs.

    Attributes
    ----------
    name, manufacturer : str
        As on the datasheet.
    grade : str
        The worse of the classes of its gyroscopes and of its accelerometers, one of `GRADES`.
    datasheet : str
        The document of the manufacturer: title, number, revision or date.
    read_in : str
        Where the figures were read.
    gyroscope, accelerometer : mapping
        Figures of the datasheet, by keys of `simnav.sensors.imu.GyroscopeSpec` and `AccelerometerSpec`, in the units of
        the datasheet. ``bias_instability`` is the level of the Allan deviation.
    effects : mapping
        The same for `simnav.sensors.imu_effects.ImuEffects`.
    correlation_time : float
        Assumed correlation time of the in-run bias [s].
    """

    name: str
    manufacturer: str
    grade: Grade
    datasheet: str
    read_in: str
    gyroscope: Mapping[str, float]
    accelerometer: Mapping[str, float]
    effects: Mapping[str, float] = field(default_factory=dict)
    correlation_time: float = _MEMS

    @property
    def assumed(self) -> Mapping[str, Mapping[str, float]]:
        """The figures that are assumed of its grade, by triad and key: those that its datasheet does not state."""
        of_grade = ASSUMED.get(self.grade)
        if of_grade is None:
            return {"gyroscope": {}, "accelerometer": {}}
        return {
            triad: {key: value for key, value in figures.items() if _field(key) not in map(_field, stated)}
            for triad, figures, stated in (
                ("gyroscope", of_grade.gyroscope, self.gyroscope),
                ("accelerometer", of_grade.accelerometer, self.accelerometer),
            )
        }

    def to_toml(self) -> dict[str, Any]:
        """The tables ``gyroscope``, ``accelerometer`` and ``effects`` of ``[instruments.imu]``."""
        tables: dict[str, Any] = {}
        for name, figures in (("gyroscope", self.gyroscope), ("accelerometer", self.accelerometer)):
            table: dict[str, Any] = {}
            for key, value in {**figures, **self.assumed[name]}.items():
                in_run = _field(key) == "bias_instability"
                table[key] = value / MARKOV_PEAK if in_run else value
                if in_run:
                    table["correlation_time_s"] = self.correlation_time
            tables[name] = table
            if self.assumed[name]:
                table["assumed"] = [_field(key) for key in self.assumed[name]]
        if self.effects:
            tables["effects"] = dict(self.effects)
        return tables


def _field(key: str) -> str:
    """The figure that a key gives, without its unit."""
    return next((name for name in _FIELDS if key.startswith(f"{name}_")), key)


_MODELS = (
    ImuModel(
        "MTi-1", "Xsens", "mems",
        datasheet="MTi 1-series Data Sheet",
        read_in="table 'Characteristics of IMU Xsens MTI-1 sensors' of Transactions on Aerospace Research 2023, "
        "doi 10.2478/tar-2023-0022",
        gyroscope={"random_walk_deg_s_sqrt_hz": 0.007, "bias_instability_deg_h": 10.0, "range_deg_s": 2000.0},
        accelerometer={"random_walk_ug_sqrt_hz": 120.0, "bias_instability_mg": 0.03, "range_g": 16.0},
        effects={"gyroscope_bandwidth_hz": 255.0, "accelerometer_bandwidth_hz": 324.0},
    ),
    ImuModel(
        "VN-100", "VectorNav", "mems",
        datasheet="VN-100 product brief and User Manual UM001",
        read_in="two public projects that quote it: gyroscopes 0.0035 deg/s/sqrt(Hz) and < 10 deg/h, accelerometers "
        "0.14 mg/sqrt(Hz) and < 0.04 mg",
        gyroscope={"random_walk_deg_s_sqrt_hz": 0.0035, "bias_instability_deg_h": 10.0},
        accelerometer={"random_walk_mg_sqrt_hz": 0.14, "bias_instability_mg": 0.04},
    ),
    ImuModel(
        "MTi-630", "Xsens", "mems",
        datasheet="MTi 600-series Datasheet, document MT1603P, revision 2020.A, June 2020",
        read_in="IMU page of the dataset 3D LiDAR SLAM Benchmark at iiLab; ranges in the listing of the datasheet",
        gyroscope={"random_walk_deg_s_sqrt_hz": 0.007, "bias_instability_deg_h": 8.0, "range_deg_s": 2000.0},
        accelerometer={"random_walk_ug_sqrt_hz": 60.0, "bias_instability_ug": 15.0, "range_g": 10.0},
    ),
    ImuModel(
        "ADIS16488", "Analog Devices", "industrial",
        datasheet="ADIS16488 Data Sheet",
        read_in="the example of NaveGo and a project after it, which quote the data sheet; its bias repeatability, 0.2 "
        "deg/s and 16 mg, covers the life of a unit and all temperatures",
        gyroscope={"random_walk_deg_sqrt_h": 0.3, "bias_instability_deg_h": 6.25},
        accelerometer={"random_walk_m_s_sqrt_h": 0.029, "bias_instability_mg": 0.1},
    ),
    ImuModel(
        "SCH16T-K01", "Murata", "industrial",
        datasheet="SCH16T-K01 Data Sheet, Doc. No. 11624, Rev. 2, January 2024, tables 4 and 6",
        read_in="the text of the data sheet; its offsets, 0.6 deg/s and 0.14 m/s^2, are limits over all temperatures",
        gyroscope={
            "random_walk_deg_sqrt_h": 0.015,
            "bias_instability_deg_h": 0.5 * _FLICKER,
            "scale_percent": 0.3 / 3.0,
            "range_deg_s": 300.0,
        },
        accelerometer={
            "random_walk_mm_s_sqrt_h": 30.0,
            "bias_instability_mm_s2": 0.20 * _FLICKER,
            "scale_percent": 0.15 / 3.0,
            "range_m_s2": 80.0,
        },
        effects={"gyroscope_g_sensitivity_deg_s_g": 0.006 * 9.80665},
    ),
    ImuModel(
        "STIM300", "Safran Sensing Technologies (Sensonor)", "tactical",
        datasheet="STIM300 Inertia Measurement Unit, document TS1524, rev. 9, accelerometers of 10 g",
        read_in="documentation of NavToolkit (stim300_model), which quotes rev. 9; angular random walk and bias "
        "instability also in quotations of rev. 31; bias instability is the lowest point of the Allan curve by the "
        "manufacturer's FAQ. Turn-on bias of gyroscopes: the error over static temperatures, 5 deg/h; the bias range, "
        "250 deg/h, is a limit over the life of a unit. Of accelerometers: bias on/off, 0.75 mg",
        gyroscope={
            "bias_deg_h": 5.0,
            "random_walk_deg_sqrt_h": 0.15,
            "bias_instability_deg_h": 0.5,
            "scale_ppm": 500.0,
            "misalignment_mrad": 1.0,
            "range_deg_s": 400.0,
        },
        accelerometer={
            "bias_mg": 0.75 / 3.0,
            "random_walk_m_s_sqrt_h": 0.06,
            "bias_instability_mg": 0.05,
            "scale_ppm": 300.0,
            "misalignment_mrad": 1.0,
            "range_g": 10.0,
        },
        effects={"gyroscope_g_sensitivity_deg_h_g": 1.0},
    ),
    ImuModel(
        "DMU41", "Silicon Sensing", "tactical",
        datasheet="DMU41 datasheet",
        read_in="a public project that quotes the datasheet and the paper of the dataset Boreas Road Trip "
        "(arXiv 2602.16870)",
        gyroscope={"random_walk_deg_sqrt_h": 0.02, "bias_instability_deg_h": 0.1},
        accelerometer={"random_walk_m_s_sqrt_h": 0.05, "bias_instability_ug": 15.0},
    ),
    ImuModel(
        "HG1700", "Honeywell", "tactical",
        datasheet="HG1700 Inertial Measurement Unit, brochure N61-1619-000-001, the best of the series",
        read_in="documentation of NavToolkit (hg1700_model), which quotes the brochure",
        gyroscope={"bias_deg_h": 1.0, "random_walk_deg_sqrt_h": 0.125},
        accelerometer={"bias_mg": 1.0, "random_walk_ft_s_sqrt_h": 0.065},
        correlation_time=_OPTICAL,
    ),
    ImuModel(
        "PRIMUS 200", "Safran (Sagem)", "tactical",
        datasheet="PRIMUS 200 specification sheet",
        read_in="documentation of NavToolkit (sagem_primus200_model), which quotes the sheet. Its gyroscopes are of "
        "intermediate grade, its accelerometers of tactical grade",
        gyroscope={"bias_deg_h": 0.05, "random_walk_deg_sqrt_h": 0.004, "scale_ppm": 10.0},
        accelerometer={"bias_mg": 2.0, "random_walk_ug_sqrt_hz": 60.0, "scale_ppm": 500.0},
        correlation_time=_OPTICAL,
    ),
    ImuModel(
        "Intermediate class", "no unit", "intermediate",
        datasheet="none: no datasheet of this grade was found that states both triads",
        read_in="all figures are assumed",
        gyroscope={},
        accelerometer={},
        correlation_time=_OPTICAL,
    ),
    ImuModel(
        "HG9900", "Honeywell", "navigation",
        datasheet="HG9900 Inertial Measurement Unit, brochure N61-1638-000-000; it states no velocity random walk",
        read_in="documentation of NavToolkit (hg9900_model), which quotes the brochure",
        gyroscope={"bias_deg_h": 0.0035, "random_walk_deg_sqrt_h": 0.002, "scale_ppm": 5.0},
        accelerometer={"bias_ug": 25.0, "scale_ppm": 100.0},
        correlation_time=_OPTICAL,
    ),
)  # fmt: skip

#: The IMUs by name and grade, from the least accurate grade to the best.
IMU_MODELS: Mapping[str, ImuModel] = {model.name: model for model in _MODELS}

#: Name of a grade -> the IMU that stands for it.
GRADES: Mapping[Grade, str] = {
    "mems": "MTi-1",
    "industrial": "ADIS16488",
    "tactical": "STIM300",
    "intermediate": "Intermediate class",
    "navigation": "HG9900",
}
assert set(GRADES) == set(get_args(Grade))


def imu_model(name: str) -> ImuModel:
    """The IMU of a name, in upper or lower case, or that of a grade.

    Raises
    ------
    SpecError
        If there is none.

    Examples
    --------
    >>> imu_model("tactical").name
    'STIM300'
    """
    if name in GRADES:
        return IMU_MODELS[GRADES[name]]  # type: ignore[index]
    for model in _MODELS:
        if model.name.lower() == name.lower():
            return model
    near = closest(name.lower(), [m.name.lower() for m in _MODELS])
    known = {m.name.lower(): m.name for m in _MODELS}
    for lower, right in known.items():
        near = near.replace(f"'{lower}'", f"'{right}'")
    if "did you mean" not in near:
        near = f"; there are: {', '.join(IMU_MODELS)}"
    raise SpecError(f"there is no IMU of the name {name!r}{near}")
