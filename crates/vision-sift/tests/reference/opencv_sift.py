#!/usr/bin/env python3
"""Reference numbers for tests/it/validation.rs: OpenCV's SIFT on the scene of tests/it/pictures.rs.

Needs numpy and opencv-python-headless (made with 5.0.0). Writes opencv_sift.csv beside this file: a comment with the
picture's size and the sum of its grey values, a header, then one row per keypoint and orientation, strongest first.
The upscaling without the quarter-pixel shift is chosen, so coordinates are those of the input pixels.
"""
import os

import cv2
import numpy as np

WIDTH, HEIGHT, SIDE, ROWS = 160, 120, 160.0, 60


def scene(width, height, side):
    """The same 500 spots as `scene` in tests/it/pictures.rs, term by term in the same order."""
    state = 2004

    def following():
        nonlocal state
        state = (state * 1664525 + 1013904223) % 2**32
        return (state >> 16) / 65536.0

    y, x = np.mgrid[0:height, 0:width].astype(np.float64)
    total = np.zeros((height, width))
    for _ in range(500):
        u, v = following() * side, following() * side
        s = 1.2 + 5.0 * following() ** 2
        a = 160.0 * (following() - 0.5)
        r2 = (x - u) ** 2 + (y - v) ** 2
        total += np.where(r2 < 36.0 * s * s, a * np.exp(-r2 / (2.0 * s * s)), 0.0)
    return np.clip(np.floor(128.0 + total + 0.5), 0, 255).astype(np.uint8)


def main():
    picture = scene(WIDTH, HEIGHT, SIDE)
    sift = cv2.SIFT_create(contrastThreshold=0.04, edgeThreshold=10, sigma=1.6, enable_precise_upscale=True)
    keypoints, descriptors = sift.detectAndCompute(picture, None)
    order = sorted(range(len(keypoints)), key=lambda i: (-keypoints[i].response, i))[:ROWS]
    target = os.path.join(os.path.dirname(os.path.abspath(__file__)), "opencv_sift.csv")
    with open(target, "w") as out:
        out.write(f"# {WIDTH}x{HEIGHT}, sum of grey values {int(picture.sum())}, {len(keypoints)} keypoints in all\n")
        out.write("x,y,sigma,angle_deg,response," + ",".join(f"d{i}" for i in range(128)) + "\n")
        for i in order:
            k = keypoints[i]
            head = f"{k.pt[0]:.4f},{k.pt[1]:.4f},{k.size / 2:.4f},{k.angle:.3f},{k.response:.6f}"
            out.write(head + "," + ",".join(str(int(v)) for v in descriptors[i]) + "\n")


if __name__ == "__main__":
    main()
