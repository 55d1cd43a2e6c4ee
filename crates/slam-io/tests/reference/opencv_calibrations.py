"""Calibrations as OpenCV's FileStorage writes them, one file a lens model, and pixels of cv2.projectPoints through
the numbers that cv2.FileStorage reads back from the files: opencv_*.yml and opencv_calibrations.csv.

    pip install opencv-python-headless numpy
    python opencv_calibrations.py check FILE.yml    # prints what OpenCV reads from a file of ours
    python opencv_calibrations.py                   # writes the files

opencv_*.yml were written with OpenCV 5.0.0, opencv4_*.yml (argument "opencv4_") with 4.x, whose header is not YAML.
A line of the csv is  file, X, Y, Z, u, v.
"""

import os
import sys

import cv2
import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
K = np.array([[458.654, 0, 367.215], [0, 457.296, 248.375], [0, 0, 1]])
FILES = {
    "radtan4": [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05],
    "radtan5": [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05, -0.003],
    "rational8": [0.45, -2.4, 9e-4, -2e-4, 1.4, 0.33, -2.2, 1.35],
    "rational14": [0.45, -2.4, 9e-4, -2e-4, 1.4, 0.33, -2.2, 1.35, 0, 0, 0, 0, 0, 0],
    "prism12": [0.45, -2.4, 9e-4, -2e-4, 1.4, 0.33, -2.2, 1.35, 0.01, 0, 0, 0],
    "fisheye": [-0.0137, 0.0207, -0.0127, 0.0025],
}
POINTS = [(0.3, 0.1, 1.0), (-0.45, 0.25, 0.9), (1.1, -0.7, 2.5)]


def read(path):
    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_READ)
    k = storage.getNode("camera_matrix").mat()
    d = storage.getNode("distortion_coefficients").mat()
    fisheye = storage.getNode("fisheye_model")
    return k, d, (not fisheye.empty()) and int(fisheye.real()) == 1


def project(path, point):
    k, d, fisheye = read(path)
    point = np.array(point).reshape(1, 1, 3)
    function = cv2.fisheye.projectPoints if fisheye else cv2.projectPoints
    return function(point, np.zeros(3), np.zeros(3), k, d)[0].ravel()


if len(sys.argv) == 3 and sys.argv[1] == "check":
    k, d, fisheye = read(sys.argv[2])
    print(repr(k.tolist()), repr(d.ravel().tolist()), fisheye)
    sys.exit()

prefix = sys.argv[1] if len(sys.argv) == 2 else "opencv_"
rows = []
for name, coefficients in FILES.items():
    path = os.path.join(HERE, f"{prefix}{name}.yml")
    storage = cv2.FileStorage(path, cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 752)
    storage.write("image_height", 480)
    storage.write("camera_matrix", K)
    storage.write("distortion_coefficients", np.array([coefficients]).T if "5" in name else np.array([coefficients]))
    if name == "fisheye":
        storage.write("fisheye_model", 1)
    storage.release()
    if name != "prism12":
        for point in POINTS:
            u, v = project(path, point)
            rows.append(",".join([name] + [repr(float(x)) for x in (*point, u, v)]))
if prefix == "opencv_":
    with open(os.path.join(HERE, "opencv_calibrations.csv"), "w") as out:
        out.write("\n".join(rows) + "\n")
