"""Draws the figure and writes the table of nearest_neighbours.py from its CSV.

    python plot_nearest_neighbours.py TABLE.csv [PICTURE] [TABLE.md]

The figure compares at comparable quality: at each size an index shows its fastest setting that keeps at least 97 % of
the exact ratio-test matches, and no point where none does; a number at the end of a name is its setting. Dashed lines
are exact methods. The name of the picture may end in .png. Needs numpy and matplotlib.
"""

import csv
import re
import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

KEPT = 0.97
EXACT = "#555555"
COLOURS = {"ours": "#0072B2", "FLANN": "#D55E00", "HNSW": "#7A3B8F", "IVF": "#009E73"}
SETTING = r"([ ,;(_=-]+(checks|ef|nprobe|probes?|leaves))?[ ,;(_=:-]+[\dx]+\)?$"


def read(path: Path) -> list[dict]:
    """Rows with numbers as floats, empty cells as NaN."""
    with open(path) as file:
        return [{k: v if k == "method" else float(v or "nan") for k, v in row.items()} for row in csv.DictReader(file)]


def lines(rows: list[dict]) -> dict[str, list[dict]]:
    """For each index its fastest row of each size that keeps enough matches."""
    best = {}
    for row in rows:
        sizes = best.setdefault(re.sub(SETTING, "", row["method"]), {})
        good = row["ratio_matches_kept"] >= KEPT
        if good and row["ms_per_300_queries"] < sizes.get(row["size"], row)["ms_per_300_queries"] + 1e-12:
            sizes[row["size"]] = row
    return {name: [sizes[n] for n in sorted(sizes)] for name, sizes in best.items() if sizes}


def spread(heights: np.ndarray, least: float) -> np.ndarray:
    """The heights moved apart to at least `least` each, in their order, about where they were."""
    order, placed = np.argsort(heights), heights.copy()
    for _ in range(500):
        gaps = np.diff(placed[order])
        short = np.clip(least - gaps, 0, None) / 2
        if not short.any():
            break
        placed[order[:-1]] -= short
        placed[order[1:]] += short
    return placed


def draw(rows: list[dict], picture: Path) -> None:
    plt.rcParams.update({"svg.hashsalt": "nearest-neighbours", "svg.fonttype": "path", "font.size": 9})
    figure, axes = plt.subplots(figsize=(7.6, 4.4), layout="constrained")
    ends = []
    for name, points in lines(rows).items():
        x, y = (np.array([p[c] for p in points]) for c in ("size", "ms_per_300_queries"))
        colour = next((c for key, c in COLOURS.items() if key in name), EXACT)
        exact = all(p["recall1"] == 1 and p["ratio_matches_kept"] == 1 for p in points)
        axes.loglog(x, y, color=colour, linestyle="--" if exact else "-", marker="o", markersize=3.5,
                    linewidth=2.2 if "ours" in name else 1.3, zorder=3 if "ours" in name else 2)
        ends.append((name, colour, x[-1], y[-1]))
    low, high = (np.log10(v) for v in axes.get_ylim())
    right = max(end[2] for end in ends)
    for name, colour, x, y in [end for end in ends if end[2] < right]:
        axes.annotate(name, (x, y), (6, 0), textcoords="offset points", color=colour, va="center")
    ends = [end for end in ends if end[2] == right]
    heights = spread(np.array([np.log10(end[3]) for end in ends]), 0.042 * (high - low))
    for (name, colour, x, y), height in zip(ends, heights):
        axes.annotate(name, (x, y), (right * 1.35, 10**height), color=colour, va="center", annotation_clip=False,
                      fontweight="bold" if "ours" in name else "normal",
                      arrowprops={"arrowstyle": "-", "color": colour, "linewidth": 0.5, "linestyle": ":"})
    axes.set(xlabel="descriptors in the map", ylabel="time of 300 queries [ms], one core", xlim=(None, right * 1.2))
    axes.grid(which="major", color="#dddddd", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.set_title(f"two nearest of 128-byte SIFT, at least {KEPT:.0%} of the ratio-test matches kept (dashed: exact)",
                   loc="left", fontsize=9)
    if picture.suffix == ".png":
        figure.savefig(picture, dpi=130)
    else:
        figure.savefig(picture, metadata={"Date": None})
    plt.close(figure)


def cell(row: dict, name: str) -> str:
    value = row[name]
    if np.isnan(value):
        return ""
    if name.startswith(("recall", "ratio")):
        return f"{value:.3f}"
    return f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def tables(rows: list[dict]) -> str:
    """A Markdown table for each size."""
    heads = {"ms_per_300_queries": "300 queries, ms", "ms_low": "least", "ms_high": "greatest",
             "recall1": "nearest found", "ratio_matches_kept": "matches kept",
             "ratio_matches_added": "matches added", "build_ms": "build, ms",
             "insert100_ms_mean": "insert 100, ms", "insert100_ms_worst": "worst", "bytes_per_descriptor": "bytes each"}
    out = []
    for size in sorted({row["size"] for row in rows}):
        out += [f"### {size:.0f} descriptors", "", "| method | " + " | ".join(heads.values()) + " |",
                "|---" + "|---:" * len(heads) + "|"]
        for row in sorted((r for r in rows if r["size"] == size), key=lambda r: r["ms_per_300_queries"]):
            out.append(f"| {row['method']} | " + " | ".join(cell(row, c) for c in heads) + " |")
        out.append("")
    return "\n".join(out)


def main(table: Path, picture: Path, text: Path | None = None) -> None:
    rows = read(table)
    draw(rows, picture)
    if text:
        text.write_text(tables(rows))


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:] if len(sys.argv) > 2 else [sys.argv[1], "nearest-neighbours.svg"]))
