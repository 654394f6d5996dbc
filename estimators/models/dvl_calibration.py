"""The 23-state model of Zhan et al. (2026): the 15 inertial states and eight errors of the DVL.

The eight are constants, after the DVL's datasheet: misalignment eta (3) [rad], lever-arm error dl (3) [m], scale-factor
error k [-] and delay tau [s]. A DVL measurement that is stamped t reads ::

    z = (1 + k) D u,    D = I - [eta x] + [eta x]^2 / 2
    u = C' v + w x (l + dl) - u' tau,    u' = f + C' g - w x C' v

with the velocity v north-east-down, the direction cosine matrix C from body axes to north-east-down, the lever arm l,
the body rate w relative to the Earth, the specific force f and gravity g; u' is the derivative of u in body axes. D is
a rotation to second order: a first-order rotation by two degrees would act like a scale factor of 5e-4. With M = (1 +
k) D and errors that are estimate minus truth, the Jacobian is

- velocity ``M C'``; attitude ``M C' [v x]``; gyroscope bias ``M [l x]``
- eta ``(1 + k) ([u x] - ([(eta x u) x] + [eta x] [u x]) / 2)``; dl ``M [w x]``; k ``D u``; tau ``-M u'``

All other instruments have no states: their biases and in-run errors count as white noise.

Source: Zhan et al. 2026, PLoS One 21(2) e0342016, eqs. 1-2 and 13-21. Where it is unclear, this holds here:

- Eq. 19 has ``v - v x eta``, but eq. 17 with the DCM C_b^d of a small turn eta is ``v - eta x v = v + v x eta``. Here
  eta is the rotation vector by which the instrument's axes are turned from the body's, hence the latter;
  `simnav.sensors.dvl` is the same, with the whole rotation.
- One lever arm and one time error are shared by GNSS and DVL in eqs. 16 and 21. Here the GNSS antenna's lever arm is
  known and its time is right; both errors are the DVL's.
- H1 of eq. 16 has 20 columns for 23 states and H2 of eq. 21 none for the time error; here the columns are as above.
- F of eq. 13 is continuous; here it is integrated (`simnav.estimators.models.inertial`), and G has 23 rows.
- The noise of the measurements is the datasheets'; the printed one is the preset ``paper``. None of the states is
  printed.
- The paper's state begins with attitude, ours with position; the eight follow in its order: eta, dl, k, tau.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from simnav import blocks
from simnav.blocks import StateBlock
from simnav.estimator import UnsuitableScenario
from simnav.estimator.needs import IMU, Needs
from simnav.geometry.earth import earth_rate, gravity
from simnav.geometry.rotation import skew
from simnav.kinds import BODY_VELOCITY, POSITION, VELOCITY, kinds_with
from simnav.types import Array, Datasheet, InitialState, Instruments, Measurement

from .base import Linearised
from .declared_errors import errors_of
from .error_states import merged
from .filtering import Aid
from .inertial import InertialModel
from .inertial_errors import ERROR, TRIAD
from .measurements import DVL, observe

__all__ = ["DvlCalibrationModel", "DvlErrors"]

#: Of each component, after the paper's simulation: "diag(0.1, 0.1, 0.1, 5, 5, 5)^2" [m/s], [m].
_PRINTED = {POSITION: 5.0, VELOCITY: 0.1, BODY_VELOCITY: 0.1}
_IDENTITY = np.eye(3)


class DvlErrors(NamedTuple):
    """Places of the DVL's errors in the error state.

    Attributes
    ----------
    misalignment, lever_arm : slice
        Three components each [rad], [m].
    scale, delay : slice
        One component each [-], [s].
    """

    misalignment: slice
    lever_arm: slice
    scale: slice
    delay: slice


class DvlCalibrationModel(InertialModel):
    """The model of the module; 23 states.

    Datasheets give the size of a DVL's scale factor and misalignment, and some also say how well the lever arm was
    measured, or how well clocks agree. Where one says nothing, these are parameters. A second DVL counts as an
    instrument without states.

    Parameters
    ----------
    lever_arm : float
        Sigma of each component of the lever-arm error [m], if the datasheet has no ``lever_arm_sigma``.
    delay : float
        Sigma of the DVL's time error [s], if the datasheet has no sigma of the offset of its stamps.
    preset : "default" or "paper"
        "paper": the noise of GNSS and DVL as printed, 5 m and 0.1 m/s, instead of the datasheets'.

    Attributes
    ----------
    places : DvlErrors
        Of the run's DVL.
    """

    fused = False

    def __init__(self, lever_arm: float = 0.02, delay: float = 0.005, preset: Literal["default", "paper"] = "default"):
        super().__init__(calibrate=False)
        if preset not in ("default", "paper"):
            raise ValueError(f'preset is {preset!r}; it must be "default" or "paper"')
        self.lever_arm, self.delay, self.preset = lever_arm, delay, preset

    @property
    def needs(self) -> Needs:
        """An IMU and a DVL."""
        return (IMU, tuple(kinds_with(BODY_VELOCITY)))

    def begin(self, start: InitialState, instruments: Instruments) -> Array:
        """Set the state; UnsuitableScenario without an IMU or a DVL."""
        dvls = instruments.of_equation(BODY_VELOCITY)
        if not dvls:
            raise UnsuitableScenario("the 23-state model needs a DVL; there is none")
        self._dvl = dvls[0]
        self._gravity = np.array([0.0, 0.0, float(gravity(start.position[0], start.position[2]))])
        covariance = super().begin(start, instruments)
        self._fused = set(self.noise) - self.uncalibrated - set(self.own) - {self._dvl.name}
        if self.preset == "paper":
            for sheet in instruments.of_equation(*_PRINTED):
                self.noise[sheet.name] = _PRINTED[sheet.equation] ** 2 * np.eye(3)
        return covariance

    def _more_blocks(self) -> None:
        name, errors = self._dvl.name, errors_of(self._dvl)
        self.blocks.add(name, "misalignment", merged(errors["misalignment"]))
        declared = next((block for block in self._dvl.blocks if block.name == blocks.LEVER_ARM), None)
        arm = declared or StateBlock(blocks.LEVER_ARM, 3, "m", self.lever_arm)
        self.blocks.add(name, arm.name, arm.rates())
        self.blocks.add(name, "scale", merged(errors["scale"]))
        timing = self._dvl.timing
        sigma = self.delay if timing is None or not timing.offset else timing.offset
        self.blocks.add(name, "delay", StateBlock("delay", 1, "s", sigma).rates())
        at = self.blocks.at
        self.places = DvlErrors(
            misalignment=at[f"{name}.misalignment"], lever_arm=at[f"{name}.{arm.name}"], scale=at[f"{name}.scale"],
            delay=at[f"{name}.delay"],
        )  # fmt: skip

    def measure(self, measurement: Measurement) -> Linearised | None:
        """Linearise one measurement: the DVL as in the module, others as in `simnav.estimators.models.measurements`."""
        if measurement.instrument == self._dvl.name:
            return self._measure_dvl(self._dvl, measurement.value)
        return super().measure(measurement)

    def _values(self, at: slice) -> Array:
        """The values of calibration states, from their places in the error state."""
        return self.calibration[at.start - ERROR.calibration : at.stop - ERROR.calibration]

    def _measure_dvl(self, sheet: Datasheet, value: Array) -> Linearised:
        at = self.places
        eta, dl = self._values(at.misalignment), self._values(at.lever_arm)
        k, tau = float(self._values(at.scale)[0]), float(self._values(at.delay)[0])
        u, raw, to_body = np.empty(3), np.empty((3, ERROR.accelerometer_bias)), self.dcm.T
        observe.unchecked(Aid(DVL, sheet.lever_arm + dl), np.zeros(3), self._state(), u, raw)
        u *= -1.0  # measured minus predicted
        turn = skew(self.raw_rate - self.bias[TRIAD.gyroscopes] - to_body @ earth_rate(float(self.position[0])))
        force = self.raw_force - self.bias[TRIAD.accelerometers]
        acceleration = force + to_body @ self._gravity - turn @ (to_body @ self.velocity)
        u -= acceleration * tau
        s, across = skew(eta), skew(u)
        turned = _IDENTITY - s + 0.5 * (s @ s)
        matrix = (1.0 + k) * turned
        jacobian = np.zeros((3, self.size))
        behind_position = slice(ERROR.velocity, ERROR.accelerometer_bias)
        jacobian[:, behind_position] = matrix @ raw[:, behind_position]
        jacobian[:, at.misalignment] = (1.0 + k) * (across - 0.5 * (skew(s @ u) + s @ across))
        jacobian[:, at.lever_arm] = matrix @ turn
        jacobian[:, at.scale] = (turned @ u)[:, None]
        jacobian[:, at.delay] = -(matrix @ acceleration)[:, None]
        return Linearised(value - matrix @ u, jacobian, self.noise[sheet.name])
