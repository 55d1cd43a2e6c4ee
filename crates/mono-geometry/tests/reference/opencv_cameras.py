"""Pixels, Jacobians and undistorted points of OpenCV for three lens models: opencv_cameras.csv.

    pip install opencv-python-headless numpy
    python opencv_cameras.py > opencv_cameras.csv

Written with OpenCV 5.0.0, numpy 2. A line is
    project, model, X, Y, Z, u, v, then row by row the derivatives of u and of v by X Y Z fx fy cx cy and the lens
    undistort, model, u, v, x, y            (normalised, undistorted)
All numbers with the digits of a double. The camera and the lenses are those of the test that reads this.
"""

import cv2
import numpy as np

K = np.array([[458.654, 0, 367.215], [0, 457.296, 248.375], [0, 0, 1]])
LENSES = {
    "radtan": [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, -0.003],
    "rational": [0.45, -2.4, 9e-4, -2e-4, 1.4, 0.33, -2.2, 1.35],
    "fisheye": [-0.0137, 0.0207, -0.0127, 0.0025],
}
RAYS = [
    (0.01, -0.02, 1.0), (0.3, 0.1, 1.0), (-0.45, 0.25, 0.9), (1.1, -0.7, 2.5), (-0.2, -0.6, 1.3),
    (0.0, 0.5, 1.0), (-2.6, 0.0, 5.0), (0.35, -0.3, 0.75), (-30.0, 21.0, 71.0), (0.004, 0.003, 0.01),
]
PIXELS = [(10.0, 20.0), (367.5, 248.0), (700.0, 460.0), (50.5, 440.25), (600.0, 30.0), (400.0, 300.0)]


def line(*fields):
    print(",".join(f if isinstance(f, str) else repr(float(f)) for f in fields))


zero = np.zeros(3)
for name, coefficients in LENSES.items():
    d = np.array(coefficients)
    for ray in RAYS:
        point = np.array(ray).reshape(1, 1, 3)
        if name == "fisheye":
            pixel, j = cv2.fisheye.projectPoints(point, zero, zero, K, d)
            # f, c, k, om, T, alpha
            j = np.hstack([j[:, 11:14], j[:, 0:8]])
        else:
            pixel, j = cv2.projectPoints(point, zero, zero, K, d)
            # om, T, f, c, k
            j = j[:, 3:]
        line("project", name, *ray, *pixel.ravel(), *j.ravel())
    for uv in PIXELS:
        pixel = np.array(uv).reshape(1, 1, 2)
        to_rounding = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 2000, 1e-15)
        if name == "fisheye":
            found = cv2.fisheye.undistortPoints(pixel, K, d, criteria=to_rounding)
        else:
            found = cv2.undistortPoints(pixel, K, d, criteria=to_rounding)
        line("undistort", name, *uv, *found.ravel())
