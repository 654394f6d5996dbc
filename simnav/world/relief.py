"""Random relief with the covariance of von Karman, by spectral synthesis: fractal below a scale, stationary above it.

With the standard deviation s, the scale a and the Hurst exponent H of the relief the spectral density at the
wavenumber k [rad/m] and the covariance at the distance r are ::

    S(k) = 4 pi H a^2 s^2 (1 + a^2 k^2)^-(H + 1)
    C(r) = s^2 2^(1 - H) / gamma(H) (r/a)^H K_H(r/a)

K_H is the modified Bessel function of the second kind. Below the scale the fractal dimension is 3 - H. With H = 1/2 the
covariance is exponential, so along a straight way the relief is a first-order Gauss-Markov process. Waves shorter than
two nodes of the grid are left out.

Source: J. A. Goff and T. H. Jordan, *Stochastic modeling of seafloor morphology: inversion of Sea Beam data for
second-order statistics*, Journal of Geophysical Research 93(B11), 1988; here in its isotropic form.
"""

from __future__ import annotations

import numpy as np

from simnav.types import Array

__all__ = ["relief"]


def relief(
    shape: tuple[int, int],
    spacing: tuple[float, float],
    sigma: float,
    scale: float,
    hurst: float,
    rng: np.random.Generator,
) -> Array:
    """A relief at the nodes of a grid, with the mean zero.

    Parameters
    ----------
    shape : (int, int)
        Numbers of nodes, north and east.
    spacing : (float, float)
        Of the nodes [m].
    sigma : float
        Standard deviation of the depth [m].
    scale : float
        Below it the relief is fractal [m].
    hurst : float
        Hurst exponent, between 0 and 1: the higher, the smoother.
    rng : numpy.random.Generator
        It draws one variate for each node of a field of twice the size, of which the grid is a part: opposite edges of
        a field of this kind go together.

    Returns
    -------
    (r, c) array
        [m]
    """
    from scipy import fft  # loaded only where there is a relief

    rows, columns = (fft.next_fast_len(2 * n, real=True) for n in shape)
    kn = 2.0 * np.pi * fft.fftfreq(rows, spacing[0])
    ke = 2.0 * np.pi * fft.rfftfreq(columns, spacing[1])
    square = (kn[:, None] ** 2 + ke[None] ** 2) * scale**2
    density = 4.0 * np.pi * hurst * (scale * sigma) ** 2 * (1.0 + square) ** -(hurst + 1.0)
    gain = np.sqrt(density / (spacing[0] * spacing[1]))
    field = fft.irfft2(fft.rfft2(rng.standard_normal((rows, columns))) * gain, s=(rows, columns))
    return np.asarray(field[: shape[0], : shape[1]])
