"""Two-view estimates of OpenCV on synthetic matches, for tests/two_view_opencv.rs.

    python opencv_two_view.py > opencv_two_view.csv

Needs numpy and opencv-python-headless (made with the version in the first line of the table). Rows, coordinates as x1 y1 x2 y2
of each match, matrices row by row:

five,case,20 normalised coordinates,9 of one essential matrix (a row for each that cv2.findEssentialMat returns)
eight,case,80 pixel coordinates of 20 noisy matches,9 of F (cv2.findFundamentalMat, FM_8POINT)
pose,case,80 normalised coordinates of 20 noisy matches,9 of E,9 of R,3 of t (cv2.recoverPose)
"""

import cv2
import numpy as np


def scene(rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    axis = rng.normal(size=3)
    rotation, _ = cv2.Rodrigues(axis / np.linalg.norm(axis) * rng.uniform(0, 0.4))
    translation = rng.normal(size=3)
    translation /= np.linalg.norm(translation)
    first, second = [], []
    while len(first) < count:
        depth = rng.uniform(2, 8)
        point = np.array([rng.uniform(-0.6, 0.6) * depth, rng.uniform(-0.5, 0.5) * depth, depth])
        moved = rotation @ point + translation
        if moved[2] > 0.3:
            first.append(point[:2] / point[2])
            second.append(moved[:2] / moved[2])
    return np.array(first), np.array(second), rotation, translation


def row(kind: str, case: int, *parts: np.ndarray) -> None:
    numbers = np.concatenate([np.asarray(p, float).ravel() for p in parts])
    print(",".join([kind, str(case)] + [repr(float(v)) for v in numbers]))


def main() -> None:
    print(f"# opencv {cv2.__version__}, numpy {np.__version__}")
    rng = np.random.default_rng(1)
    for case in range(12):
        first, second, _, _ = scene(rng, 5)
        stacked, _ = cv2.findEssentialMat(first, second, np.eye(3), method=cv2.RANSAC, prob=0.999, threshold=1e-6)
        for k in range(0, 0 if stacked is None else len(stacked), 3):
            row("five", case, np.hstack([first, second]), stacked[k:k + 3])
    camera = np.array([[700, 0, 319.5], [0, 690, 239.5], [0, 0, 1.0]])
    for case in range(10):
        first, second, _, _ = scene(rng, 20)
        pixels = [p * [700, 690] + [319.5, 239.5] + rng.normal(size=p.shape) * 0.3 for p in (first, second)]
        # cv2.findFundamentalMat works on single precision: coordinates that have no more digits.
        pixels = [p.astype(np.float32).astype(float) for p in pixels]
        f, _ = cv2.findFundamentalMat(pixels[0], pixels[1], cv2.FM_8POINT)
        row("eight", case, np.hstack(pixels), f)
        noisy = [(p - [319.5, 239.5]) / [700, 690] for p in pixels]
        e = camera.T @ f @ camera
        u, _, vt = np.linalg.svd(e)
        e = u @ np.diag([1.0, 1.0, 0.0]) @ vt
        count, rotation, translation, _ = cv2.recoverPose(e, noisy[0], noisy[1], np.eye(3))
        assert count > 10
        row("pose", case, np.hstack(noisy), e, rotation, translation)


if __name__ == "__main__":
    main()
