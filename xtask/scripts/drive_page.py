#!/usr/bin/env python3
"""Drives the report page of a run in headless Chromium and checks what it shows against the files of the run.

    python3 xtask/scripts/drive_page.py RUN [--png FOLDER] [--chromium PROGRAM]

RUN is a folder that `mono-slam run` wrote. Every frame of the page is visited with the arrow keys: its number, its words,
its counts, the number of keypoints drawn and the place of the robot must be those of the files; revisits and lost
stretches must be marked; nothing may be loaded from elsewhere and nothing may be logged as an error. With --png pictures
of the page in wide and narrow, light and dark are left in FOLDER. Only the standard library and Chromium are needed.
Exits with 1 when something is wrong, after naming it.
"""

import argparse
import base64
import csv
import json
import os
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

FATES = ["u", "n", "m", "o"]  # unused, new, matched, rejected: the order of the page
MOST_BYTES = 1_000_000


class Browser:
    """Chromium behind the pipe of its debugging protocol: messages in JSON, each ended by a zero byte."""

    def __init__(self, program, profile):
        from_us, to_browser = os.pipe()
        from_browser, to_us = os.pipe()
        os.set_inheritable(from_us, True)
        os.set_inheritable(to_us, True)

        def connect():
            # The browser reads from descriptor 3 and writes to 4.
            spare = os.dup(to_us), os.dup(from_us)
            os.dup2(spare[1], 3)
            os.dup2(spare[0], 4)

        self.process = subprocess.Popen(
            [program, "--headless", "--no-sandbox", "--disable-gpu", "--remote-debugging-pipe",
             f"--user-data-dir={profile}", "--no-first-run", "about:blank"],
            close_fds=False, preexec_fn=connect, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(from_us)
        os.close(to_us)
        self.write, self.read = to_browser, from_browser
        self.buffer, self.events, self.number, self.session = b"", [], 0, None

    def message(self):
        while b"\0" not in self.buffer:
            piece = os.read(self.read, 1 << 20)
            if not piece:
                raise RuntimeError("the browser has gone")
            self.buffer += piece
        text, _, self.buffer = self.buffer.partition(b"\0")
        return json.loads(text)

    def call(self, method, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        os.write(self.write, json.dumps(message).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error']}")
                return answer["result"]
            self.events.append(answer)

    def wait(self, method):
        while not any(event.get("method") == method for event in self.events):
            self.events.append(self.message())

    def value(self, expression):
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in result:
            raise RuntimeError(f"{expression}: {result['exceptionDetails']}")
        return result["result"].get("value")

    def open(self, path):
        self.events = [e for e in self.events if e.get("method") != "Page.loadEventFired"]
        self.call("Page.navigate", url=path.resolve().as_uri())
        self.wait("Page.loadEventFired")

    def press(self, key):
        code = {" ": "Space"}.get(key, key)
        for kind in ("rawKeyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, code=code)


SHOWN = """(() => {
  const text = (id) => document.getElementById(id).textContent;
  const canvas = document.getElementById('picture');
  const lines = [...document.querySelectorAll('.plot .now')].map((line) => Number(line.getAttribute('x1')));
  return { place: text('place'), state: text('state'), drawn: canvas.dataset.drawn, of: canvas.dataset.frame,
    facts: [...document.querySelectorAll('#facts td')].map((cell) => Number(cell.textContent)),
    robot: document.getElementById('robot').getAttribute('transform'),
    ellipse: document.getElementById('covariance').getAttribute('rx'),
    slider: Number(document.getElementById('frame').value), lines };
})()"""


def stretches(states):
    """The number of stretches of lost frames."""
    return sum(now == "lost" and before != "lost" for before, now in zip([""] + states, states))


class Check:
    def __init__(self):
        self.wrong = []
        self.done = 0

    def equal(self, what, found, expected):
        self.done += 1
        if found != expected:
            self.wrong.append(f"{what}: expected {expected}, found {found}")


def check(browser, run, check):
    with open(run / "frames.csv", newline="") as file:
        frames = {int(row["frame"]): row for row in csv.DictReader(file)}
    record = json.loads((run / "report_data.json").read_text())
    counts = {p["index"]: Counter(k[3] for k in p["keypoints"]) for p in record["pictures"]}
    size = (run / "report.html").stat().st_size
    check.equal("size of the page within its bound", size <= MOST_BYTES, True)
    for domain in ("Page", "Runtime", "Log", "Network"):
        browser.call(f"{domain}.enable")
    browser.open(run / "report.html")
    rows = browser.value("JSON.parse(document.getElementById('run-data').textContent).frames")
    pictures = browser.value("JSON.parse(document.getElementById('run-data').textContent).pictures.map((p) => p[0])")
    indices = rows["index"]
    check.equal("rows in order", indices, sorted(set(indices)))

    robots, ellipses, cursors = set(), set(), set()

    def frame(row):
        shown = browser.value(SHOWN)
        index = indices[row]
        line = frames[index]
        where = f"frame {index}"
        check.equal(f"{where}, number", shown["place"].split(",")[0], f"Frame {index} of 0 to {len(frames) - 1}")
        check.equal(f"{where}, slider", shown["slider"], row)
        expected = [int(line[c]) for c in ("keypoints", "matches", "outliers", "new_landmarks", "landmarks")]
        check.equal(f"{where}, counts", shown["facts"], expected)
        word = {"tracking": "Tracking", "lost": "Lost", "relocalised": "Found again"}[line["state"]]
        check.equal(f"{where}, words", shown["state"].startswith(word), True)
        check.equal(f"{where}, revisit in words", "Revisit:" in shown["state"], line["revisit"] == "1")
        if pictures:
            picture = indices[min(pictures, key=lambda p: abs(p - row))]
            check.equal(f"{where}, nearest picture", int(shown["of"]), picture)
            drawn = [int(n) for n in shown["drawn"].split()]
            check.equal(f"{where}, keypoints drawn", drawn, [counts[picture][fate] for fate in FATES])
            if picture == index:
                check.equal(f"{where}, all keypoints", sum(drawn), int(line["keypoints"]))
            else:
                check.equal(f"{where}, picture of another frame is said", f"frame {picture}," in shown["state"], True)
        robots.add(shown["robot"])
        ellipses.add(shown["ellipse"])
        cursors.update(shown["lines"])
        return shown

    first = frame(0)
    for row in range(1, len(indices)):
        browser.press("ArrowRight")
        frame(row)
    places = set(zip(rows["x"], rows["y"], rows["heading"]))
    check.equal("places of the robot", len(robots), len(places))
    check.equal("ellipses", len(ellipses), len(set(rows["major"])))
    if len(indices) > 1:
        check.equal("the lines of the charts move", len(cursors) >= len(set(rows["t"])), True)
    browser.press("ArrowRight")
    frame(len(indices) - 1)
    browser.press("ArrowLeft")
    frame(max(0, len(indices) - 2))
    browser.press("Home")
    check.equal("Home shows the first frame as before", frame(0), first)
    browser.press("ArrowLeft")
    frame(0)
    browser.press("End")
    frame(len(indices) - 1)
    browser.press("Home")
    browser.press(" ")
    time.sleep(1.0)
    browser.press(" ")
    played = browser.value(SHOWN)["slider"]
    check.equal("Space plays", played > 0, len(indices) > 1)
    time.sleep(0.3)
    check.equal("Space stops", browser.value(SHOWN)["slider"], played)
    browser.press("Home")

    kept = [frames[i] for i in indices]
    marked = {kind: browser.value(f"document.querySelectorAll('#marks .{kind}').length")
              for kind in ("lost", "found", "revisit")}
    expected = {"lost": stretches([r["state"] for r in kept]),
                "found": sum(r["state"] == "relocalised" for r in kept),
                "revisit": sum(r["revisit"] == "1" for r in kept)}
    check.equal("marks on the slider", marked, expected)
    for kind, name in (("lost", "lost"), ("found", "found again"), ("revisit", "revisit")):
        for place in (".wide", ".grid"):
            legend = f"[...document.querySelectorAll('{place} .key')].some((k) => k.textContent === '{name}')"
            check.equal(f"{name} in the legend of {place}", browser.value(legend), expected[kind] > 0)
    if pictures:
        for _ in range(50):
            shown = browser.value("document.getElementById('picture').dataset.picture")
            if shown == "shown":
                break
            time.sleep(0.1)
        check.equal("the picture", shown, "shown")
    strip = min(8, len(record["pictures"]))
    check.equal("pictures of the strip", browser.value("document.querySelectorAll('.strip image').length"), strip)

    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    browser.open(run / "report.html")
    hidden = "['player', 'scrub'].every((id) => document.getElementById(id).hidden)"
    check.equal("without scripts nothing is there that needs them", browser.value(hidden), True)
    check.equal("pictures without scripts", browser.value("document.querySelectorAll('.strip image').length"), strip)
    browser.call("Emulation.setScriptExecutionDisabled", value=False)

    for event in browser.events:
        params = event.get("params", {})
        if event.get("method") == "Runtime.exceptionThrown":
            check.equal("exceptions", params["exceptionDetails"].get("text"), None)
        if event.get("method") == "Log.entryAdded" and params["entry"]["level"] == "error":
            check.equal("errors in the log", params["entry"]["text"], None)
        if event.get("method") == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            check.equal("console", params["args"], None)
        if event.get("method") == "Network.requestWillBeSent":
            address = params["request"]["url"]
            check.equal("addresses", address.split(":")[0] in ("file", "data"), True)
    return size, len(indices), len(pictures), expected


def photograph(browser, run, folder):
    folder.mkdir(parents=True, exist_ok=True)
    for width, height in ((1280, 900), (390, 844)):
        for scheme in ("light", "dark"):
            browser.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                         mobile=width < 600)
            browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
            browser.open(run / "report.html")
            browser.value("(() => { const s = document.getElementById('frame'); s.value = s.max / 2;"
                          " s.dispatchEvent(new Event('input')); })()")
            time.sleep(0.5)
            for name, more in (("top", {}), ("page", {"captureBeyondViewport": True, "clip": {
                    "x": 0, "y": 0, "width": width, "scale": 1,
                    "height": browser.value("document.documentElement.scrollHeight")}})):
                picture = browser.call("Page.captureScreenshot", format="png", **more)["data"]
                (folder / f"{name}-{width}-{scheme}.png").write_bytes(base64.b64decode(picture))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("--png", type=Path, metavar="FOLDER")
    parser.add_argument("--chromium", default="chromium", metavar="PROGRAM")
    arguments = parser.parse_args()
    result = Check()
    with tempfile.TemporaryDirectory() as profile:
        browser = Browser(arguments.chromium, profile)
        try:
            target = browser.call("Target.createTarget", url="about:blank")["targetId"]
            session = browser.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
            browser.session = session
            size, rows, pictures, marks = check(browser, arguments.run, result)
            if arguments.png:
                photograph(browser, arguments.run, arguments.png)
        finally:
            browser.process.terminate()
            browser.process.wait()
    for fault in result.wrong[:20]:
        print(fault)
    verdict = f"{len(result.wrong)} wrong" if result.wrong else "nothing wrong"
    print(f"{arguments.run.name}: {size} bytes, {rows} frames, {pictures} pictures, marks {marks}; "
          f"{result.done} checks, {verdict}")
    sys.exit(1 if result.wrong else 0)


if __name__ == "__main__":
    main()
