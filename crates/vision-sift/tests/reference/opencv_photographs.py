#!/usr/bin/env python3
"""OpenCV's SIFT on photographs and on the drawn scene, for tests/it/opencv_mode.rs.

    opencv_photographs.py FOLDER [SOURCE]   writes the photographs and OpenCV's features into FOLDER
    opencv_photographs.py --scene           writes opencv_mode.csv beside this file

Needs numpy, opencv-python-headless (made with 5.0.0) and, for the photographs, scikit-image, whose wheel holds them
(skimage/data; SOURCE is another folder with the same files). Their licences differ, so neither they nor what is
computed from them is committed.

A photograph becomes grey by the whole-number formula (299 R + 587 G + 114 B + 500) / 1000, rounded down, and is then
reduced by area averaging to fit into 320x240; FOLDER/NAME.pgm. FOLDER/NAME.csv has a comment with the size and the sum
of the grey values, a header, then one row per keypoint and orientation: upscale (0 the default doubling, 1
enable_precise_upscale), x, y, sigma (half of size), angle in degrees, response, the 128 descriptor values as two
hexadecimal digits each. Parameters are those of cv2.SIFT_create(), one thread.
"""
import os
import sys

import cv2
import numpy as np

from opencv_sift import scene

PHOTOGRAPHS = [
    "astronaut.png",
    "camera.png",
    "brick.png",
    "gravel.png",
    "rocket.jpg",
    "coffee.png",
    "motorcycle_left.png",
]
LARGEST = (320, 240)
SCENE = (240, 180, 240.0)


def grey_photograph(path):
    """The picture as grey values, at most as large as LARGEST."""
    colour = cv2.imread(path, cv2.IMREAD_COLOR)
    if colour is None:
        sys.exit(f"cannot read {path}")
    blue, green, red = (colour[:, :, i].astype(np.uint32) for i in range(3))
    grey = ((299 * red + 587 * green + 114 * blue + 500) // 1000).astype(np.uint8)
    height, width = grey.shape
    scale = min(LARGEST[0] / width, LARGEST[1] / height, 1.0)
    return cv2.resize(grey, (round(width * scale), round(height * scale)), interpolation=cv2.INTER_AREA)


def write_features(target, picture):
    """The features of both ways of doubling, in OpenCV's order."""
    height, width = picture.shape
    with open(target, "w") as out:
        out.write(f"# {width}x{height}, sum of grey values {int(picture.sum())}, OpenCV {cv2.__version__}\n")
        out.write("upscale,x,y,sigma,angle_deg,response,descriptor\n")
        for precise in (False, True):
            sift = cv2.SIFT_create(enable_precise_upscale=precise)
            keypoints, descriptors = sift.detectAndCompute(picture, None)
            for k, d in zip(keypoints, descriptors if keypoints else []):
                place = f"{k.pt[0]:.3f},{k.pt[1]:.3f},{k.size / 2:.4f},{k.angle:.2f},{k.response:.5f}"
                out.write(f"{int(precise)},{place},{d.astype(np.uint8).tobytes().hex()}\n")
            print(f"{target}: {len(keypoints)} keypoints, enable_precise_upscale={precise}")


def main():
    cv2.setNumThreads(1)
    if sys.argv[1:] == ["--scene"]:
        folder = os.path.dirname(os.path.abspath(__file__))
        write_features(os.path.join(folder, "opencv_mode.csv"), scene(*SCENE))
        return
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    folder = sys.argv[1]
    if len(sys.argv) == 3:
        source = sys.argv[2]
    else:
        import skimage

        source = os.path.join(os.path.dirname(skimage.__file__), "data")
    os.makedirs(folder, exist_ok=True)
    for name in PHOTOGRAPHS:
        picture = grey_photograph(os.path.join(source, name))
        stem = os.path.join(folder, name.split(".")[0])
        cv2.imwrite(stem + ".pgm", picture)
        write_features(stem + ".csv", picture)


if __name__ == "__main__":
    main()
