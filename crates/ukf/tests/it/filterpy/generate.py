"""Reference values of tests/it/val_filterpy.rs: three published examples through filterpy's UnscentedKalmanFilter.

    pip install numpy filterpy==2.0.0
    python generate.py          # writes *.csv beside this file

filterpy 2.0.0 draws its sigma points again after process noise was added, as crate `ukf` does. Each row of
a table: the measurement, then mean and covariance (row by row) after the update, for the scaled points (alpha
0.5, beta 2, kappa 1) and for Julier's (kappa 1). Rows are steps of predict and update.
"""

from pathlib import Path

import filterpy
import numpy as np
from filterpy.kalman import JulierSigmaPoints, MerweScaledSigmaPoints, UnscentedKalmanFilter

HERE = Path(__file__).parent
STEPS = 40


def wrap(angle):
    return np.pi - (np.pi - angle) % (2 * np.pi)


class FallingBody:
    """A body falls through the atmosphere, a radar beside its path measures the distance: Athans, Wishner and
    Bertolini 1968. Altitude (feet), speed downwards (feet/s), ballistic coefficient; one Euler step a second
    in 20 parts."""

    name = "falling_body"
    start, covariance = np.array([3e5, 2e4, 3e-5]), np.diag([1e6, 4e6, 1e-6])
    truth = np.array([3e5, 2e4, 1e-3])
    q, r = np.diag([1e-2, 1e-2, 1e-16]), np.array([[1e4]])
    names = None

    @staticmethod
    def f(x, dt):
        for _ in range(20):
            drag = np.exp(-5e-5 * x[0]) * x[1] ** 2 * x[2]
            x = x + 0.05 * np.array([-x[1], -drag, 0.0])
        return x

    @staticmethod
    def h(x):
        return np.array([np.hypot(1e5, x[0] - 1e5)])

    options = {}


class VanDerPol:
    """The Van der Pol oscillator with its position measured: Kandepu, Foss and Imsland 2008. One Euler step of 0.1."""

    name = "van_der_pol"
    start, covariance = np.array([0.0, 5.0]), np.array([[1.0, 0.2], [0.2, 2.0]])
    truth = np.array([1.4, 0.0])
    q, r = np.array([[1e-3, 2e-4], [2e-4, 1e-3]]), np.array([[1e-2]])

    @staticmethod
    def f(x, dt):
        return x + 0.1 * np.array([x[1], 0.2 * (1.0 - x[0] ** 2) * x[1] - x[0]])

    @staticmethod
    def h(x):
        return x[:1]

    options = {}


def residual(a, b):
    d = a - b
    d[-1] = wrap(d[-1])
    return d


def reference_mean(points, weights):
    """Mean about the first point, the image of the centre."""
    return normal(points[0] + sum(w * residual(p.copy(), points[0]) for p, w in zip(points, weights)))


def normal(x):
    x = np.array(x)
    x[-1] = wrap(x[-1])
    return x


class Beacons:
    """A robot on a circle, range and bearing to one beacon a step, heading across the cut: the localisation example of
    Thrun, Burgard and Fox 2005, chapter 7. Angles are averaged about the centre point's."""

    name = "beacons"
    start, covariance = np.array([0.2, -0.1, 2.8]), np.array([[0.3, 0.05, 0.0], [0.05, 0.2, 0.02], [0.0, 0.02, 0.1]])
    truth = np.array([0.0, 0.0, 2.9])
    q = np.array([[1e-3, 2e-4, 0.0], [2e-4, 1e-3, 1e-4], [0.0, 1e-4, 2e-3]])
    r = np.array([[0.04, 0.002], [0.002, 0.01]])
    beacon = np.array([-6.0, 2.0])

    @staticmethod
    def f(x, dt):
        return normal([x[0] + 0.3 * np.cos(x[2] + 0.05), x[1] + 0.3 * np.sin(x[2] + 0.05), x[2] + 0.1])

    @classmethod
    def h(cls, x):
        d = cls.beacon - x[:2]
        return normal([np.hypot(*d), np.arctan2(d[1], d[0]) - x[2]])

    options = dict(
        x_mean_fn=reference_mean, z_mean_fn=reference_mean, residual_x=residual, residual_z=residual,
        state_add=lambda x, d: normal(x + d),
    )


def run(model, points):
    n, m = len(model.start), len(model.r)
    rng = np.random.default_rng(2006)
    ukf = UnscentedKalmanFilter(n, m, 1.0, model.h, model.f, points, **model.options)
    ukf.x, ukf.P, ukf.Q, ukf.R = model.start.copy(), model.covariance.copy(), model.q, model.r
    truth = model.truth.copy()
    rows = []
    for _ in range(STEPS):
        truth = model.f(truth, 1.0)
        z = model.h(truth) + rng.multivariate_normal(np.zeros(m), model.r)
        ukf.predict()
        ukf.update(z)
        rows.append(np.concatenate([z, ukf.x, ukf.P.ravel()]))
    return rows


for model in (FallingBody, VanDerPol, Beacons):
    n = len(model.start)
    sets = [MerweScaledSigmaPoints(n, alpha=0.5, beta=2.0, kappa=1.0), JulierSigmaPoints(n, kappa=1.0)]
    scaled, julier = (run(model, points) for points in sets)
    m = len(model.r)
    table = [np.concatenate([a, b[m:]]) for a, b in zip(scaled, julier)]
    text = "\n".join(",".join(repr(float(v)) for v in row) for row in table)
    (HERE / f"{model.name}.csv").write_text(text + "\n")
    print(model.name, "final", scaled[-1][m : m + n])
print("filterpy", filterpy.__version__, "numpy", np.__version__)
