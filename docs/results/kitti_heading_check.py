"""Turn between frames of the car sequence from images alone, against its reference.

Usage: kitti_heading_check.py FOLDER   (numpy, opencv-python-headless)
FOLDER holds images/NNNNNN.png and groundtruth.txt (TUM, camera-to-world).
"""
import sys

import cv2
import numpy as np

FOLDER = sys.argv[1].rstrip("/") + "/"
K = np.array([[353.5456, 0, 300.69365], [0, 353.5456, 91.3052], [0, 0, 1]])
STEP = 3

poses = np.array(
    [[float(v) for v in line.split()] for line in open(FOLDER + "groundtruth.txt") if line[0] != "#"]
)


def rotation(q):
    x, y, z, w = q
    return np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])


sift = cv2.SIFT_create()
features = [
    sift.detectAndCompute(cv2.imread(FOLDER + f"images/{i:06d}.png", 0), None) for i in range(len(poses))
]
matcher = cv2.BFMatcher()
total = 0.0
for a in range(0, len(poses) - STEP, STEP):
    b = a + STEP
    pairs = matcher.knnMatch(features[a][1], features[b][1], k=2)
    good = [m for m, n in pairs if m.distance < 0.7 * n.distance]
    p = np.array([features[a][0][m.queryIdx].pt for m in good])
    q = np.array([features[b][0][m.trainIdx].pt for m in good])
    essential, mask = cv2.findEssentialMat(p, q, K, cv2.USAC_MAGSAC, 0.9999, 0.5)
    _, turn, _, _ = cv2.recoverPose(essential, p, q, K, mask=mask.copy())
    reference = rotation(poses[b][4:]).T @ rotation(poses[a][4:])
    difference = cv2.Rodrigues(turn @ reference.T)[0].ravel() * 1e3
    total += difference[1]
    print(f"{a:3d} {b:3d}  yaw difference {difference[1]:6.2f} mrad, summed {total:6.2f}")
