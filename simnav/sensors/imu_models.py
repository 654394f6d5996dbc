"""Inertial measurement units by name and by grade, with the figures of their manufacturers.

The figures are entered in the units of the datasheets. Three rules lead from a datasheet to the error model of
`simnav.sensors.imu`:

- Limits (plus or minus) are taken as three sigma, other figures as one sigma.
- Bias instability is a level of the Allan deviation: its lowest point, or that point divided by 0.664 (the coefficient
  of flicker noise, IEEE Std 952-1997, annex C). The in-run bias of simnav is a first-order Gauss-Markov process, whose
  Allan deviation has its maximum at 0.6173 of its standard deviation. The standard deviation is chosen so that this
  maximum is the level that the datasheet states.
- No datasheet states a correlation time. It is set to 300 s for MEMS and to 3600 s for optical gyroscopes.

What a datasheet does not state is zero (noise, biases) or without limit (ranges). `ImuModel.read_in` says where the
figures were read, because not every datasheet is public. The revision of the datasheet is given where the reading says
it. A unit whose figures only one project quotes, without a revision, is not listed.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from simnav.spec import SpecError, closest

__all__ = ["GRADES", "IMU_MODELS", "MARKOV_PEAK", "Grade", "ImuModel", "imu_model"]

#: Largest Allan deviation of a first-order Gauss-Markov process over its standard deviation, at 1.89 correlation times:
#: IEEE Std 952-1997, annex C, eq. C.12 (0.437 q sqrt(T) with q = sigma sqrt(2 / T)).
MARKOV_PEAK = 0.6173
#: Lowest Allan deviation of flicker noise over its coefficient: sqrt(2 ln 2 / pi).
_FLICKER = 0.664
_MEMS, _OPTICAL = 300.0, 3600.0

Grade = Literal["mems", "industrial", "tactical", "intermediate", "navigation"]


@dataclass(frozen=True)
class ImuModel:
    """An IMU of a manufacturer.

    Attributes
    ----------
    name, manufacturer : str
        As on the datasheet.
    grade : str
        Class of its gyroscopes, one of `GRADES`.
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

    def to_toml(self) -> dict[str, Any]:
        """The tables ``gyroscope``, ``accelerometer`` and ``effects`` of ``[instruments.imu]``."""
        tables: dict[str, Any] = {}
        for name, figures in (("gyroscope", self.gyroscope), ("accelerometer", self.accelerometer)):
            table: dict[str, float] = {}
            for key, value in figures.items():
                in_run = key.startswith("bias_instability")
                table[key] = value / MARKOV_PEAK if in_run else value
                if in_run:
                    table["correlation_time_s"] = self.correlation_time
            tables[name] = table
        if self.effects:
            tables["effects"] = dict(self.effects)
        return tables


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
        read_in="the example of NaveGo and a project after it, which quote the data sheet",
        gyroscope={
            "bias_deg_s": 0.2,
            "random_walk_deg_sqrt_h": 0.3,
            "bias_instability_deg_h": 6.25,
        },
        accelerometer={"bias_mg": 16.0, "random_walk_m_s_sqrt_h": 0.029, "bias_instability_mg": 0.1},
    ),
    ImuModel(
        "SCH16T-K01", "Murata", "industrial",
        datasheet="SCH16T-K01 Data Sheet, Doc. No. 11624, Rev. 2, January 2024, tables 4 and 6",
        read_in="the text of the data sheet",
        gyroscope={
            "bias_deg_s": 0.6 / 3.0,
            "random_walk_deg_sqrt_h": 0.015,
            "bias_instability_deg_h": 0.5 * _FLICKER,
            "scale_percent": 0.3 / 3.0,
            "range_deg_s": 300.0,
        },
        accelerometer={
            "bias_m_s2": 0.14 / 3.0,
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
        "manufacturer's FAQ",
        gyroscope={
            "bias_deg_h": 250.0 / 3.0,
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
        "PRIMUS 200", "Safran (Sagem)", "intermediate",
        datasheet="PRIMUS 200 specification sheet",
        read_in="documentation of NavToolkit (sagem_primus200_model), which quotes the sheet",
        gyroscope={"bias_deg_h": 0.05, "random_walk_deg_sqrt_h": 0.004, "scale_ppm": 10.0},
        accelerometer={"bias_mg": 2.0, "random_walk_ug_sqrt_hz": 60.0, "scale_ppm": 500.0},
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

#: The IMUs by name, from the least accurate gyroscopes to the best.
IMU_MODELS: Mapping[str, ImuModel] = {model.name: model for model in _MODELS}

#: Name of a grade -> the IMU that stands for it.
GRADES: Mapping[Grade, str] = {
    "mems": "MTi-1",
    "industrial": "ADIS16488",
    "tactical": "STIM300",
    "intermediate": "PRIMUS 200",
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
