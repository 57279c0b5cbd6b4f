"""Draw the stored pictures of docs/pictures.yaml, and record when they were made: `make pictures`.

Parts of a report are screenshots, which need Chromium or Chrome. The picture of Meshcat is made by hand.

usage: draw_pictures.py [NAME ...]        all groups that can be drawn without a name
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from PIL import Image, ImageChops

ROOT = Path(__file__).resolve().parents[1]
IMAGES = ROOT / "docs" / "images"
COMMAND = Path(sys.executable).with_name("drake-tc")
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
JOINT = "simulated_knee"
WIDTH, HEIGHT, MARGIN = 960, 6000, 14
"""Of the browser's window, and of the border around what is kept [pixels]."""
COLOURS = 40
BOLD, FAINT, ACCENT = "#0171b2", "#8a7d6c", "#b5179e"
PARTS = {
    "notebooks/images/report.png": ("header", "summary", "What was missing"),
    "docs/images/report_residual.png": ("Measured and modelled effort", "Residual, held-out runs"),
    "docs/images/report_parameters.png": ("Equations of the model after", "Parameters"),
    "docs/images/tutorial_missing.png": ("What was missing",),
}
"""Screenshot to the parts of the report that it shows: headings, `header` and `summary`."""
KEEP = """<script>
const kept = %s;
document.querySelectorAll("main > header, main > section, main > footer, article > section").forEach((part) => {
  const head = part.querySelector("h2"), title = head ? head.firstChild.data.trim() : "";
  const name = part.matches("header") ? "header" : part.matches(".summary") ? "summary" : title;
  if (!kept.includes(name)) part.remove();
});
</script></body>"""


def demo(folder: Path) -> Path:
    """The folder of the demo, which is made once."""
    if not (folder / "report.html").exists():
        subprocess.run([COMMAND, "demo", "--out", folder], check=True)
    return folder


def draw_report(folder: Path) -> None:
    """Screenshots of parts of the demo's report."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        sys.exit(f"screenshots need a browser; none of these was found: {', '.join(BROWSERS)}")
    page = (demo(folder) / "report.html").read_text("utf-8")
    for path, parts in PARTS.items():
        part, raw = folder / "part.html", folder / "part.png"
        part.write_text(page.replace("</body>", KEEP % list(parts)), encoding="utf-8")
        options = ["--headless=new", "--hide-scrollbars", "--disable-gpu", f"--window-size={WIDTH},{HEIGHT}"]
        options += ["--no-sandbox"] if os.geteuid() == 0 else []
        command = [browser, *options, "--virtual-time-budget=5000", f"--screenshot={raw}", part.as_uri()]
        subprocess.run(command, check=True, capture_output=True)
        _small(_trimmed(Image.open(raw).convert("RGB")), ROOT / path)


def draw_logs(folder: Path) -> None:
    """The runs of the demo, and a damaged log beside what is read of it."""
    logs = demo(folder) / "demo_logs"
    names = ("postures_with_pushes", "growing_sinusoid", "multisine_held_out")
    tables = {name: pd.read_parquet(logs / f"{name}.parquet") for name in names}
    figure = Figure(figsize=(9.0, 3.4), layout="constrained")
    axes = figure.subplots(2, 3, sharex=True, sharey="row")
    for (name, table), (top, bottom) in zip(tables.items(), axes.T, strict=True):
        every = table.iloc[::30]
        top.plot(every["time"], every[f"{JOINT}/position"], color=BOLD, linewidth=0.8)
        bottom.plot(every["time"], every[f"{JOINT}/torque"], color=FAINT, linewidth=0.8)
        top.set_title(name, loc="left", fontsize=9)
        bottom.set_xlabel("time [s]")
    axes[0, 0].set_ylabel("position [rad]")
    axes[1, 0].set_ylabel("torque [N·m]")
    _save(figure, IMAGES / "tutorial_runs.png")
    _draw_repairs(tables["growing_sinusoid"], folder)


def _draw_repairs(table: pd.DataFrame, folder: Path) -> None:
    from drake_tc.logs.prepare import load_runs
    from drake_tc.logs.rig import load_rig

    column, rng = f"{JOINT}/position", np.random.default_rng(0)
    recorded = table[(table["time"] > 16.0) & (table["time"] < 24.0)].iloc[::4].reset_index(drop=True)
    recorded["time"] += rng.normal(0.0, 2e-4, len(recorded))
    recorded.loc[[300, 1150], column] += [0.35, -0.3]
    recorded.loc[1500:, column] += 2.0 * np.pi
    recorded = recorded.drop(index=range(700, 790))
    recorded.to_csv(folder / "damaged.csv", index=False)
    (run,) = load_runs([folder / "damaged.csv"], load_rig(folder / "demo_logs" / "rig.yaml"))
    inside = (run.segment >= 0) & (np.diff(run.segment, append=run.segment[-1]) == 0)
    read = np.where(inside, run.columns[column], np.nan)
    figure = Figure(figsize=(9.0, 3.0), layout="constrained")
    axes = figure.add_subplot()
    time = recorded["time"] - recorded["time"].iloc[0]
    axes.plot(time, recorded[column], ".", color=FAINT, markersize=3.0, label="recorded")
    axes.plot(run.time - run.time[0], read, color=BOLD, linewidth=1.1, label="read")
    for text, at, height in (
        ("spike", time.iloc[300], 0.95),
        ("lost rows", time.iloc[700], 0.95),
        ("spike", time.iloc[1150 - 90], -0.95),
        ("jump by a turn", time.iloc[1500 - 90], 5.3),
    ):
        axes.annotate(text, (at, height), color=ACCENT, fontsize=9, ha="center")
    axes.set_xlabel("time [s]")
    axes.set_ylabel("position [rad]")
    axes.legend(frameon=False, loc="center left")
    _save(figure, IMAGES / "log_repairs.png")


def draw_run(folder: Path) -> None:
    """The plot of a simulated run."""
    command = [COMMAND, "simulate", "hrp2_leg", "--plot", folder / "swing.png"]
    subprocess.run(command, check=True, capture_output=True)
    _small(Image.open(folder / "swing.png").convert("RGB"), IMAGES / "swing.png")


def _save(figure: Figure, path: Path) -> None:
    for axes in figure.axes:
        axes.grid(color="#dddddd", linewidth=0.5)
        axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=110)
    _small(Image.open(path).convert("RGB"), path)


def _trimmed(image: Image.Image) -> Image.Image:
    """Without the empty rows below its content."""
    plain = Image.new("RGB", image.size, image.getpixel((0, image.height - 1)))
    box = ImageChops.difference(image, plain).getbbox()
    return image if box is None else image.crop((0, 0, image.width, min(box[3] + MARGIN, image.height)))


def _small(image: Image.Image, path: Path) -> None:
    image.quantize(COLOURS, dither=Image.Dither.NONE).save(path, optimize=True)


DRAWN: Mapping[str, Callable[[Path], None]] = {"report": draw_report, "logs": draw_logs, "run": draw_run}
"""By group of pictures.yaml."""


def main(names: Sequence[str]) -> None:
    """Draw these groups."""
    if unknown := [name for name in names if name not in DRAWN]:
        sys.exit(f"no pictures {unknown[0]!r} that can be drawn; groups: {', '.join(DRAWN)}")
    with tempfile.TemporaryDirectory() as folder:
        for name in names or DRAWN:
            DRAWN[name](Path(folder) / "demo" if name != "run" else Path(folder))


if __name__ == "__main__":
    main(sys.argv[1:])
