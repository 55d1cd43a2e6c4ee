"""Draws docs/images/shared-maps.svg from the table of `cargo run --release -p rbpf-core --example share_maps`.

    python docs/results/plot_maps.py docs/results/2026-11-23-maps.csv [picture]

Needs numpy and matplotlib. The name of the picture may end in .png.
"""

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

PICTURE = Path(__file__).parents[1] / "images" / "shared-maps.svg"


def main() -> None:
    table = np.genfromtxt(sys.argv[1], delimiter=",", names=True)
    picture = sys.argv[2] if len(sys.argv) > 2 else PICTURE
    plt.rcParams.update({"svg.hashsalt": "shared-maps", "svg.fonttype": "path", "font.size": 9})
    figure, (time, memory) = plt.subplots(1, 2, figsize=(8, 3.6), layout="constrained")
    for updates, line in ((0, "-"), (10, "--")):
        rows = table[table["updates"] == updates]
        what = "" if updates == 0 else ", 10 updates each"
        for name, label, colour in (("plain", "plain vectors", "C1"), ("shared", "shared maps", "C0")):
            style = {"color": colour, "linestyle": line, "marker": "o", "markersize": 4}
            time.loglog(rows["landmarks"], rows[f"{name}_us"] * 1e-6, label=label + what, **style)
            memory.loglog(rows["landmarks"], rows[f"{name}_bytes"], **style)
    time.set_ylabel("time, seconds")
    memory.set_ylabel("bytes beside the old map")
    for axes in (time, memory):
        axes.set_xlabel("landmarks in a map")
        axes.grid(True, which="major", alpha=0.3)
    figure.suptitle("Resampling of 100 particles")
    figure.legend(*time.get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    metadata = {"Date": None} if str(picture).endswith(".svg") else None
    figure.savefig(picture, dpi=110, metadata=metadata)


main()
