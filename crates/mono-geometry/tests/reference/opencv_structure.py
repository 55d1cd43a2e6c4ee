#!/usr/bin/env python3
"""Reference numbers for tests/val_structure.rs: OpenCV's solveP3P, solvePnP, correctMatches and triangulatePoints, and
scipy's least_squares.

Needs numpy, scipy and opencv-python-headless (made with numpy 2.4.6, scipy 1.17.1, OpenCV 5.0.0). Writes opencv_structure.csv beside this file,
one problem a row:

p3p,    3 points (9), 3 pixels (6), then per solution rvec, tvec of camera_from_world (6 each, up to 4 of them)
pnp,    n, n points (3 n), n pixels (2 n), rvec, tvec (solvePnP ITERATIVE, then solvePnPRefineLM to its end)
match,  rvec, tvec of second_from_first, first pixel, second pixel, both corrected (4), point in the first camera (3),
        then by least_squares from there: the point of least reprojection error (3) and its sum of squares

With the argument `time` it times the four functions per call instead (CPU time, one thread, median of 20 rounds).
"""
import os
import sys
import time

import cv2
import numpy as np
import scipy
from scipy.optimize import least_squares

K = np.array([[368.8262, 0.0, 159.67029], [0.0, 369.90239, 121.54136], [0.0, 0.0, 1.0]])


def project(points, rvec, tvec):
    rotation, _ = cv2.Rodrigues(rvec)
    local = points @ rotation.T + tvec
    pixels = local @ K.T
    return pixels[:, :2] / pixels[:, 2:]


def random_pose(rng):
    axis = rng.normal(size=3)
    rvec = axis / np.linalg.norm(axis) * rng.uniform(0.0, 3.0)
    return rvec, rng.normal(size=3)


def seen_points(rng, count, planar):
    """Points in front of the camera, given in the world of a random pose."""
    rvec, tvec = random_pose(rng)
    rotation, _ = cv2.Rodrigues(rvec)
    depth = np.full(count, 4.0) if planar else rng.uniform(2.0, 8.0, count)
    local = np.stack([rng.uniform(-0.4, 0.4, count) * depth, rng.uniform(-0.3, 0.3, count) * depth, depth], axis=1)
    if planar:
        local[:, 2] += 0.5 * local[:, 0] - 0.3 * local[:, 1]
    return (local - tvec) @ rotation, rvec, tvec


def p3p(points, pixels):
    _, rvecs, tvecs = cv2.solveP3P(points, pixels, K, None, flags=cv2.SOLVEPNP_P3P)
    return rvecs, tvecs


def pnp(points, pixels):
    _, rvec, tvec = cv2.solvePnP(points, pixels, K, None, flags=cv2.SOLVEPNP_ITERATIVE)
    end = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 200, 1e-15)
    rvec, tvec = cv2.solvePnPRefineLM(points, pixels, K, None, rvec, tvec, criteria=end)
    return rvec.ravel(), tvec.ravel()


def fundamental(rvec, tvec):
    rotation, _ = cv2.Rodrigues(rvec)
    cross = np.array([[0, -tvec[2], tvec[1]], [tvec[2], 0, -tvec[0]], [-tvec[1], tvec[0], 0]])
    inverse = np.linalg.inv(K)
    return inverse.T @ cross @ rotation @ inverse


def correct(rvec, tvec, first, second):
    a, b = cv2.correctMatches(fundamental(rvec, tvec), first.reshape(1, 1, 2), second.reshape(1, 1, 2))
    return a.ravel(), b.ravel()


def triangulate(rvec, tvec, a, b):
    rotation, _ = cv2.Rodrigues(rvec)
    first = K @ np.hstack([np.eye(3), np.zeros((3, 1))])
    second = K @ np.hstack([rotation, tvec.reshape(3, 1)])
    point = cv2.triangulatePoints(first, second, a.reshape(2, 1), b.reshape(2, 1)).ravel()
    return point[:3] / point[3]


def minimise(rvec, tvec, first, second, start):
    def residuals(point):
        a = project(point[None], np.zeros(3), np.zeros(3))[0]
        b = project(point[None], rvec, tvec)[0]
        return np.concatenate([a - first, b - second])

    found = least_squares(residuals, start, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return found.x, 2.0 * found.cost


def match(rng):
    rvec, tvec = rng.normal(size=3) * 0.1, rng.normal(size=3) * np.array([0.5, 0.2, 0.3])
    depth = rng.uniform(2.0, 8.0)
    point = np.array([[rng.uniform(-0.3, 0.3) * depth, rng.uniform(-0.2, 0.2) * depth, depth]])
    first = project(point, np.zeros(3), np.zeros(3))[0] + rng.normal(size=2) * 2.0
    second = project(point, rvec, tvec)[0] + rng.normal(size=2) * 2.0
    return rvec, tvec, first, second


def main():
    rng = np.random.default_rng(30)
    rows = []
    for _ in range(200):
        points, rvec, tvec = seen_points(rng, 3, False)
        pixels = project(points, rvec, tvec)
        rvecs, tvecs = p3p(points, pixels)
        solutions = [np.concatenate([r.ravel(), t.ravel()]) for r, t in zip(rvecs, tvecs)]
        rows.append(["p3p", *points.ravel(), *pixels.ravel(), *np.concatenate(solutions)])
    for count, planar in [(6, False), (8, False), (30, False), (8, True), (30, True)] * 8:
        points, rvec, tvec = seen_points(rng, count, planar)
        pixels = project(points, rvec, tvec) + rng.normal(size=(count, 2)) * 0.5
        rvec, tvec = pnp(points, pixels)
        rows.append(["pnp", count, *points.ravel(), *pixels.ravel(), *rvec, *tvec])
    for _ in range(200):
        rvec, tvec, first, second = match(rng)
        a, b = correct(rvec, tvec, first, second)
        point = triangulate(rvec, tvec, a, b)
        best, cost = minimise(rvec, tvec, first, second, point)
        rows.append(["match", *rvec, *tvec, *first, *second, *a, *b, *point, *best, cost])
    path = os.path.join(os.path.dirname(os.path.abspath(__file__)), "opencv_structure.csv")
    with open(path, "w", encoding="ascii") as out:
        out.write(f"# OpenCV {cv2.__version__}, numpy {np.__version__}, scipy {scipy.__version__}\n")
        for row in rows:
            out.write(",".join(v if isinstance(v, str) else repr(float(v)) for v in row) + "\n")


def per_call(name, run, repeat=2000):
    rounds = []
    for _ in range(20):
        start = time.process_time()
        for _ in range(repeat):
            run()
        rounds.append((time.process_time() - start) / repeat)
    print(f"{name}: {np.median(rounds) * 1e6:.2f} us")


def timing():
    cv2.setNumThreads(1)
    rng = np.random.default_rng(1)
    points, rvec, tvec = seen_points(rng, 3, False)
    pixels = project(points, rvec, tvec)
    per_call("solveP3P (P3P)", lambda: cv2.solveP3P(points, pixels, K, None, flags=cv2.SOLVEPNP_P3P))
    per_call("solveP3P (AP3P)", lambda: cv2.solveP3P(points, pixels, K, None, flags=cv2.SOLVEPNP_AP3P))
    many, r, t = seen_points(rng, 20, False)
    noisy = project(many, r, t) + rng.normal(size=(20, 2)) * 0.5
    start = (r + 0.05).reshape(3, 1), (t + 0.05).reshape(3, 1)
    per_call("solvePnPRefineLM, 20 points",
             lambda: cv2.solvePnPRefineLM(many, noisy, K, None, start[0].copy(), start[1].copy()), 200)
    per_call("solvePnP ITERATIVE, 20 points", lambda: cv2.solvePnP(many, noisy, K, None), 200)
    rvec, tvec, first, second = match(rng)
    f = fundamental(rvec, tvec)
    a, b = first.reshape(1, 1, 2), second.reshape(1, 1, 2)
    per_call("correctMatches, one", lambda: cv2.correctMatches(f, a, b))
    thousand = np.repeat(a, 1000, axis=1), np.repeat(b, 1000, axis=1)
    per_call("correctMatches, a thousand", lambda: cv2.correctMatches(f, *thousand), 5)
    rotation, _ = cv2.Rodrigues(rvec)
    p1, p2 = K @ np.eye(3, 4), K @ np.hstack([rotation, tvec.reshape(3, 1)])
    a, b = first.reshape(2, 1), second.reshape(2, 1)
    per_call("triangulatePoints, one", lambda: cv2.triangulatePoints(p1, p2, a, b))
    a, b = np.repeat(a, 1000, axis=1), np.repeat(b, 1000, axis=1)
    per_call("triangulatePoints, a thousand", lambda: cv2.triangulatePoints(p1, p2, a, b), 20)


if __name__ == "__main__":
    if sys.argv[1:] == ["time"]:
        timing()
    else:
        main()
