#!/bin/sh
# Quality of the keypoints side by side with OpenCV, on pairs of pictures with a known homography.
#
#   sift_quality.sh SCORER PHOTOGRAPHS GRAF MONO_SLAM OUT
#
# SCORER       sift_eval.py (its header defines the scores)
# PHOTOGRAPHS  folder of pictures; each is rendered at 320x240 under the scorer's 27 warps
# GRAF         folder of a planar set: img1..img6, H1to2p..H1to6p
# MONO_SLAM    the built program
# OUT          folder for pictures, features and tables
#
# PYTHON names an interpreter with numpy and opencv-python-headless, default python3.
# Prints one table per set and metric (l2: bytes as they are; root: Hellinger), and by kind of warp for the first.
set -eu
[ $# -eq 5 ] || { sed -n '2,13s/^# \{0,1\}//p' "$0"; exit 2; }
scorer=$1 photographs=$2 graf=$3 mono_slam=$4 out=$5
python=${PYTHON:-python3}
mkdir -p "$out"

"$python" "$scorer" render --out "$out/warps" --size 320x240 "$photographs"/*
"$python" "$scorer" planar --out "$out/graf" "$graf"
"$python" "$scorer" planar --out "$out/graf320" --size 320x240 "$graf"

# The program reads PNG, the scorer writes PGM. The second of OpenCV's ways of doubling has no option in the scorer.
"$python" - "$out" <<'PYTHON'
import glob, os, sys
import cv2, numpy as np
cv2.setNumThreads(1)
sift = cv2.SIFT_create(nfeatures=0, nOctaveLayers=3, contrastThreshold=0.04, edgeThreshold=10, sigma=1.6,
                       enable_precise_upscale=True)
for name in ('warps', 'graf', 'graf320'):
    root = os.path.join(sys.argv[1], name)
    for folder in ('png', 'precise'):
        os.makedirs(os.path.join(root, folder), exist_ok=True)
    for path in sorted(glob.glob(root + '/img/*.pgm')):
        stem = os.path.basename(path)[:-4]
        image = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
        cv2.imwrite(f'{root}/png/{stem}.png', image, [cv2.IMWRITE_PNG_COMPRESSION, 1])
        keypoints, descriptors = sift.detectAndCompute(image, None)
        rows = [[k.pt[0], k.pt[1], k.size / 2, k.angle, k.response] for k in keypoints]
        if descriptors is None:
            descriptors = np.zeros((0, 128))
        np.savez(f'{root}/precise/{stem}.npz', kp=np.array(rows, np.float32).reshape(-1, 5),
                 desc=descriptors.astype(np.uint8))
PYTHON

for name in warps graf graf320; do
    "$python" "$scorer" opencv --data "$out/$name" --contrast 0.04 --out "$out/$name/opencv"
    mkdir -p "$out/$name/ours"
    "$mono_slam" features "$out/$name"/png/*.png --out "$out/$name/ours"
    for metric in l2 root; do
        by=none
        [ "$name $metric" = "warps l2" ] && by=group
        echo "## $name, $metric"
        "$python" "$scorer" score --data "$out/$name" --metric $metric --by $by \
            --det opencv="$out/$name/opencv" --det precise="$out/$name/precise" --det ours="$out/$name/ours"
    done
done
