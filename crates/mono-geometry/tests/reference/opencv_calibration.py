#!/usr/bin/env python3
"""Reference numbers for tests/opencv_calibration.rs: OpenCV's calibration of simulated corners.

Needs numpy and opencv-python-headless (made with 5.0.0). Writes opencv_calibration.txt beside this file. With --time
it writes nothing and prints the median time of cv2.calibrateCamera on 40 views of 54 corners instead (the corners of
benches/calibration.rs: same generator, same arithmetic).

The board has 9 x 6 corners 1/32 m apart; pixels are multiples of 1/4096. Both are exact in the single precision that
OpenCV reads, so both programs get the same numbers.

Format: one case a block. "case NAME VIEWS"; "truth ..." (the simulated parameters); then a "view" line per view with
108 integers, pixel * 4096, x y alternating, corner k at (k % 9, k / 9) / 32 m; then "parameters ..." (fx fy cx cy and
the lens, OpenCV's order), "sigmas ..." (its standard deviations, empty where it gives none), "errors ..." (its
per-view errors, root mean square; empty for the fisheye), "rms ...".
"""
import os
import sys
import time

import cv2
import numpy as np

WIDTH, HEIGHT = 640, 480
BOARD = np.array([[(k % 9) / 32, (k // 9) / 32, 0.0] for k in range(54)])


class Uniform:
    """Linear congruential numbers in [0, 1), the same in benches/calibration.rs."""

    def __init__(self, seed):
        self.state = seed

    def __call__(self, low=0.0, high=1.0):
        self.state = (self.state * 1664525 + 1013904223) % 2**32
        return low + (high - low) * ((self.state >> 8) / 16777216.0)

    def gauss(self):
        return sum(self() for _ in range(12)) - 6.0


def project(points, rotation_vector, translation, camera, lens, fisheye):
    function = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    pixels, _ = function(points.reshape(-1, 1, 3), rotation_vector, translation, camera, lens)
    return pixels.reshape(-1, 2)


def corners(f, lens, views, sigma, seed, fisheye=False):
    """Views with all corners in the image, tilted by 0.3 to 0.9 rad."""
    uniform = Uniform(seed)
    camera = np.array([[f, 0, 315.3], [0, 1.004 * f, 246.1], [0, 0, 1]])
    result = []
    while len(result) < views:
        tilt, about, roll = uniform(0.3, 0.9), uniform(0.0, 2 * np.pi), uniform(-0.3, 0.3)
        depth = uniform(0.25, 0.5) * max(f / 400.0, 0.4)
        x, y = uniform(-300.0, 300.0) / f, uniform(-220.0, 220.0) / f
        rotation_vector = np.array([tilt * np.cos(about), tilt * np.sin(about), roll])
        rotation, _ = cv2.Rodrigues(rotation_vector)
        translation = depth * np.array([x, y, 1.0]) - rotation @ np.array([0.125, 0.078125, 0.0])
        if ((rotation @ BOARD.T).T + translation)[:, 2].min() < 0.02:
            continue
        pixels = project(BOARD, rotation_vector, translation, camera, lens, fisheye)
        inside = (pixels > 1.0).all() and (pixels < [WIDTH - 2.0, HEIGHT - 2.0]).all()
        if not inside:
            continue
        noise = np.array([[uniform.gauss(), uniform.gauss()] for _ in range(54)]) * sigma
        result.append(np.round((pixels + noise) * 4096.0) / 4096.0)
    return camera, result


CRITERIA = (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 2000, 1e-15)


def calibrate(views, flags, criteria=CRITERIA):
    board = BOARD.astype(np.float32)
    pixels = [v.astype(np.float32) for v in views]
    return cv2.calibrateCameraExtended(
        [board] * len(views), pixels, (WIDTH, HEIGHT), None, None, flags=flags, criteria=criteria
    )


def calibrate_fisheye(views):
    board = [BOARD.reshape(1, -1, 3) for _ in views]
    pixels = [v.reshape(1, -1, 2) for v in views]
    flags = cv2.CALIB_RECOMPUTE_EXTRINSIC | cv2.CALIB_FIX_SKEW
    return cv2.fisheye.calibrate(board, pixels, (WIDTH, HEIGHT), None, None, flags=flags, criteria=CRITERIA)


RADTAN = np.array([-0.28, 0.09, 4e-4, -3e-4, 0.0])
RATIONAL = np.array([0.22, 0.68, 5e-4, -4e-4, 0.105, 0.78, 0.547, 0.219])
FISHEYE = np.array([-0.012, 0.021, -0.014, 0.0031])


def line(file, name, values):
    print(" ".join([name, *(repr(float(v)) for v in np.ravel(values))]), file=file)


def block(file, name, truth, views):
    print(f"case {name} {len(views)}", file=file)
    line(file, "truth", truth)
    for pixels in views:
        print(" ".join(["view", *(str(int(v)) for v in np.ravel(pixels * 4096.0))]), file=file)


def write(file):
    print(f"# opencv {cv2.__version__}, numpy {np.__version__}", file=file)
    for name, f, lens, count, flags in [
        ("radtan", 530.0, RADTAN, 8, cv2.CALIB_FIX_K3),
        ("radtan_k3", 530.0, RADTAN, 8, 0),
        ("rational", 260.0, RATIONAL, 8, cv2.CALIB_RATIONAL_MODEL),
    ]:
        camera, views = corners(f, lens, 8, 0.2, 7)
        rms, k, d, _, _, sigmas, _, errors = calibrate(views, flags)
        d, sigmas = d.ravel()[:count], sigmas.ravel()
        block(file, name, [*camera[[0, 1, 0, 1], [0, 1, 2, 2]], *lens], views)
        line(file, "parameters", [*k[[0, 1, 0, 1], [0, 1, 2, 2]], *d])
        line(file, "sigmas", sigmas[: 4 + count])
        line(file, "errors", errors)
        line(file, "rms", [rms])
    camera, views = corners(220.0, FISHEYE, 8, 0.2, 8, fisheye=True)
    rms, k, d, _, _ = calibrate_fisheye(views)
    block(file, "kannala_brandt", [*camera[[0, 1, 0, 1], [0, 1, 2, 2]], *FISHEYE], views)
    line(file, "parameters", [*k[[0, 1, 0, 1], [0, 1, 2, 2]], *d.ravel()])
    line(file, "sigmas", [])
    line(file, "errors", [])
    line(file, "rms", [rms])


def measure():
    cv2.setNumThreads(1)
    _, views = corners(530.0, RADTAN, 40, 0.2, 9)
    times = []
    for _ in range(15):
        start = time.perf_counter()
        rms, k, *_ = calibrate(views, cv2.CALIB_FIX_K3, (cv2.TERM_CRITERIA_COUNT + cv2.TERM_CRITERIA_EPS, 30, 2.3e-16))
        times.append(time.perf_counter() - start)
    print(f"{1e3 * np.median(times):.2f} ms, rms {rms!r}, fx {k[0, 0]!r}")


def main():
    if "--time" in sys.argv:
        measure()
        return
    with open(os.path.join(os.path.dirname(__file__), "opencv_calibration.txt"), "w") as file:
        write(file)


if __name__ == "__main__":
    main()
