"""NEES of a finished run against its planar reference.

Usage: nees_check.py RUN_FOLDER groundtruth_planar.csv   (numpy)
Prints mean and median over the frames, divided by the 3 degrees of freedom: 1 is right.
"""
import csv
import math
import sys

import numpy as np


def rows(path):
    return [[float(v) for v in row] for row in list(csv.reader(open(path)))[1:]]


poses = [[float(v) for v in line.split()] for line in open(sys.argv[1] + "/trajectory.tum") if line[0] != "#"]
values = []
for pose, c, truth in list(zip(poses, rows(sys.argv[1] + "/covariance.csv"), rows(sys.argv[2])))[1:]:
    heading = 2 * math.atan2(pose[6], pose[7]) - truth[4]
    error = np.array([pose[1] - truth[2], pose[2] - truth[3], math.remainder(heading, 2 * math.pi)])
    covariance = np.array([[c[2], c[3], c[4]], [c[3], c[5], c[6]], [c[4], c[6], c[7]]])
    values.append(error @ np.linalg.solve(covariance, error) / 3)
print(f"mean {np.mean(values):.2f}, median {np.median(values):.2f}")
